#include "imaging/sweep.hpp"

#include "core/errors.hpp"
#include "imaging/detail/frame_transforms.hpp"
#include "imaging/detail/header_checks.hpp"
#include "imaging/detail/image_header.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <fstream>
#include <iomanip>
#include <map>
#include <set>
#include <sstream>
#include <string_view>

namespace tissuewarp::imaging {
namespace fs = std::filesystem;

namespace {

using detail::FrameFields;
using detail::SweepHeader;

constexpr auto image = "Image", probe = "Probe";
constexpr double smallest_pixel_mm = 0.005, largest_pixel_mm = 2.0, largest_frame_mm = 500;
constexpr double most_skew = 0.1;  // cosine between rows and columns: calibrations have a few thousandths

void require_brightness(const fs::path& path, const SweepHeader& header) {
    if (!header.type.empty() && header.type != "BRIGHTNESS")
        throw detail::unusable(path, "its frames are " + detail::shortened(header.type) + "; give brightness (B-mode)");
    const bool plain = header.voxels.type == detail::Scalar::UInt8 || header.voxels.type == detail::Scalar::UInt16;
    if (header.voxels.channels != 1 || !plain)
        throw detail::unusable(
            path,
            "its pixels are colours, or no brightness of 8 or 16 bits without sign; write MET_UCHAR or MET_USHORT");
}

/// From pixels as they are stored to those that transforms are about: the image axes marked, far.
Eigen::Affine3d to_marked_far(const fs::path& path, const SweepHeader& header) {
    std::string word = header.orientation;
    std::transform(word.begin(), word.end(), word.begin(), [](unsigned char c) { return std::toupper(c); });
    Eigen::Affine3d turned = Eigen::Affine3d::Identity();
    if (word.empty()) return turned;
    const bool known = (word.size() == 2 || word.size() == 3) && (word[0] == 'M' || word[0] == 'U') &&
                       (word[1] == 'F' || word[1] == 'N');
    if (!known)
        throw detail::unusable(path, "UltrasoundImageOrientation '" + detail::shortened(word) +
                                         "' is none of brightness images; write MF, MN, UF or UN");
    const auto turn = [&](Eigen::Index axis) {
        turned.linear()(axis, axis) = -1;
        turned.translation()[axis] = header.voxels.size[static_cast<std::size_t>(axis)] - 1;
    };
    if (word[0] == 'U') turn(0);
    if (word[1] == 'N') turn(1);
    return turned;
}

std::string rounded(double mm) {
    std::ostringstream text;
    text << std::setprecision(3) << mm;
    return text.str();
}

void require_pixels_of_a_probe(const fs::path& path, int number, const SweepHeader& header,
                               const Eigen::Affine3d& to_patient) {
    const Eigen::Vector3d column = to_patient.linear().col(0), row = to_patient.linear().col(1);
    const double across = column.norm(), along = row.norm();
    const auto plausible = [](double mm) { return mm >= smallest_pixel_mm && mm <= largest_pixel_mm; };
    const bool large =
        header.voxels.size[0] * across > largest_frame_mm || header.voxels.size[1] * along > largest_frame_mm;
    if (large || !plausible(across) || !plausible(along) || std::abs(column.dot(row)) > most_skew * across * along)
        throw detail::unusable(path, "the " + std::to_string(header.voxels.size[0]) + " x " +
                                         std::to_string(header.voxels.size[1]) + " pixels of its frame " +
                                         std::to_string(number) + " are " + rounded(across) + " x " + rounded(along) +
                                         " mm, or skewed, as no probe has them; the transform from Image must take "
                                         "pixels to mm");
}

/// Calibrations start from the identity: who forgot one has pixels of a millimetre.
void doubt_calibration(Sweep& sweep) {
    constexpr double within_mm = 1e-5;  // files have six digits
    const Eigen::Matrix3d axes = sweep.frames.front().to_patient.linear();
    const auto is_unit = [&](Eigen::Index axis) { return std::abs(axes.col(axis).norm() - 1) < within_mm; };
    if (is_unit(0) && is_unit(1))
        sweep.notes.push_back(
            "pixels are exactly 1 x 1 mm, as those of a probe that was never calibrated: check the "
            "transform from Image");
}

/// The third axis becomes the unit normal, and RAS becomes LPS.
Eigen::Affine3d in_patient(const Eigen::Affine3d& pixels_to_system, Axes axes) {
    Eigen::Affine3d placed = pixels_to_system;
    if (axes == Axes::RAS) placed = Eigen::Scaling(-1.0, -1.0, 1.0) * placed;
    placed.linear().col(2) = placed.linear().col(0).cross(placed.linear().col(1)).normalized();
    return placed;
}

/// The value of an attribute of an XML element, or "".
std::string attribute(const std::string& element, const std::string& name) {
    for (std::size_t at = element.find(name); at != std::string::npos; at = element.find(name, at + 1)) {
        const std::size_t equals = element.find_first_not_of(" \t\r\n", at + name.size());
        if (!std::isspace(static_cast<unsigned char>(element[at - 1])) || equals == std::string::npos ||
            element[equals] != '=')
            continue;
        const std::size_t quote = element.find_first_not_of(" \t\r\n", equals + 1);
        if (quote == std::string::npos || (element[quote] != '"' && element[quote] != '\'')) continue;
        const std::size_t end = element.find(element[quote], quote + 1);
        if (end != std::string::npos) return element.substr(quote + 1, end - quote - 1);
    }
    return "";
}

/// Elements <Transform …> of XML, without those in comments.
std::vector<std::string> transform_elements(const std::string& text) {
    constexpr std::string_view tag = "<Transform", comment = "<!--";
    std::vector<std::string> elements;
    for (std::size_t at = text.find('<'); at != std::string::npos; at = text.find('<', at + 1)) {
        const bool commented = text.compare(at, comment.size(), comment) == 0;
        const std::size_t end = commented ? text.find("-->", at) : text.find('>', at);
        if (end == std::string::npos) break;
        const char behind = text[std::min(at + tag.size(), text.size() - 1)];
        if (text.compare(at, tag.size(), tag) == 0 && (std::isspace(static_cast<unsigned char>(behind)) != 0))
            elements.push_back(text.substr(at, end - at));
        at = end;
    }
    return elements;
}

std::string joined(const std::set<std::string>& names) {
    std::string text;
    for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
    return text.empty() ? "none" : detail::shortened(text);
}

/// From pixels to the patient's system. A calibration that was given goes before what the file says.
std::optional<Eigen::Affine3d> way_to_patient(const detail::FrameTransforms& transforms, const SweepOptions& options) {
    if (!options.image_to_probe) return transforms.between(image, options.to);
    auto way = transforms.between(probe, options.to);
    if (way) *way = *way * *options.image_to_probe;
    return way;
}

/// A tracker that loses a probe may say OK all the same: frames far from all others would spread the volume over what
/// nothing shows.
void leave_out_strays(Sweep& sweep) {
    constexpr double least_mm = 100, medians = 6;
    const Eigen::Vector3d in_frame(0.5 * sweep.columns(), 0.5 * sweep.rows(), 0);
    const auto median = [](std::vector<double> values) {
        const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
        std::nth_element(values.begin(), middle, values.end());
        return *middle;
    };
    Eigen::Vector3d middle;
    std::vector<double> values(sweep.frames.size());
    for (Eigen::Index a = 0; a < 3; ++a) {
        for (std::size_t n = 0; n < values.size(); ++n) values[n] = (sweep.frames[n].to_patient * in_frame)[a];
        middle[a] = median(values);
    }
    const auto away = [&](const SweepFrame& frame) { return (frame.to_patient * in_frame - middle).norm(); };
    std::transform(sweep.frames.begin(), sweep.frames.end(), values.begin(), away);
    const double most = std::max(least_mm, medians * median(values));
    std::string numbers;
    std::erase_if(sweep.frames, [&](const SweepFrame& frame) {
        if (away(frame) <= most) return false;
        if (numbers.size() < 60) numbers += (numbers.empty() ? "" : ", ") + std::to_string(frame.slice);
        return true;
    });
    if (!numbers.empty())
        sweep.notes.push_back("frames that lie more than " + std::to_string(std::lround(most)) +
                              " mm from the others are left out: " + numbers);
}

[[noreturn]] void refuse_without_way(const fs::path& path, const std::map<int, FrameFields>& frames,
                                     const SweepOptions& options) {
    std::set<std::string> systems;
    for (const auto& [number, frame] : frames) systems.merge(frame.transforms.systems());
    const bool calibrated = options.image_to_probe || systems.contains(image);
    throw detail::unusable(path, "no frame has transforms that are OK from " + std::string(image) + " to " +
                                     options.to + "; its coordinate systems are: " + joined(systems) +
                                     (calibrated ? ". Name the patient's with --to"
                                                 : ". Give the probe's calibration with --calibration"));
}

}  // namespace

Eigen::Affine3d read_calibration(const fs::path& path) {
    constexpr std::size_t longest = 1 << 22;
    std::ifstream file(path, std::ios::binary);
    if (!file) throw IoError("cannot open '" + path.string() + "'; check the path and its rights");
    std::string text(longest, '\0');
    file.read(text.data(), static_cast<std::streamsize>(text.size()));
    text.resize(static_cast<std::size_t>(file.gcount()));
    if (text.find('<') == std::string::npos) return detail::affine_of(path, "text", text);
    std::optional<Eigen::Affine3d> found;
    for (const std::string& element : transform_elements(text)) {
        if (attribute(element, "From") != image || attribute(element, "To") != probe) continue;
        const Eigen::Affine3d transform =
            detail::affine_of(path, "transform from Image to Probe", attribute(element, "Matrix"));
        if (found && !found->isApprox(transform))
            throw detail::unusable(path, "it has two transforms from Image to Probe; leave the true one");
        found = transform;
    }
    if (found) return *found;
    throw detail::unusable(path,
                           "it has no <Transform From=\"Image\" To=\"Probe\" Matrix=\"…\">; give the "
                           "configuration of a calibrated probe");
}

Sweep read_sweep(const fs::path& path, const SweepOptions& options) {
    const SweepHeader header = detail::read_meta_sweep_header(path);
    require_brightness(path, header);
    const Eigen::Affine3d stored = to_marked_far(path, header);
    Sweep sweep;
    sweep.pixels = detail::read_stored_voxels(path, header.voxels);
    for (const detail::Piece& piece : header.voxels.pieces) sweep.files.push_back(piece.file);
    const int count = header.voxels.size[2];
    const std::map<int, FrameFields> fields = detail::frame_fields(path, header.frames, count);
    for (const auto& [number, frame] : fields) {
        const auto way = way_to_patient(frame.transforms, options);
        if (!frame.image_ok || !way) continue;
        sweep.frames.push_back({number, in_patient(*way * stored, options.axes)});
        require_pixels_of_a_probe(path, number, header, sweep.frames.back().to_patient);
    }
    if (sweep.frames.empty()) refuse_without_way(path, fields, options);
    if (const std::size_t left_out = static_cast<std::size_t>(count) - sweep.frames.size(); left_out > 0)
        sweep.notes.push_back(std::to_string(left_out) + " of " + std::to_string(count) +
                              " frames are left out, whose image or place is not OK");
    doubt_calibration(sweep);
    leave_out_strays(sweep);
    return sweep;
}

}  // namespace tissuewarp::imaging
