#include "imaging/sweep.hpp"

#include "core/errors.hpp"
#include "imaging/detail/frame_transforms.hpp"
#include "imaging/detail/header_checks.hpp"
#include "imaging/detail/image_header.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iomanip>
#include <regex>
#include <set>
#include <sstream>

namespace tissuewarp::imaging {
namespace fs = std::filesystem;

namespace {

using detail::FrameFields;
using detail::SweepHeader;

constexpr auto image = "Image", probe = "Probe";
constexpr double smallest_pixel_mm = 0.005, largest_pixel_mm = 2.0;
constexpr double most_skew = 0.1;  // cosine between rows and columns: calibrations have a few thousandths

void require_brightness(const fs::path& path, const SweepHeader& header) {
    if (!header.type.empty() && header.type != "BRIGHTNESS")
        throw detail::unusable(path, "its frames are " + header.type + "; give brightness (B-mode)");
    const bool plain = header.voxels.type == detail::Scalar::UInt8 || header.voxels.type == detail::Scalar::UInt16;
    if (header.voxels.channels != 1 || !plain)
        throw detail::unusable(path, "its pixels are colours or no brightness of 8 or 16 bits; convert them to grey");
}

/// From pixels as they are stored to those that transforms are about: the image axes marked, far.
Eigen::Affine3d to_marked_far(const fs::path& path, const SweepHeader& header) {
    const std::string& word = header.orientation;
    Eigen::Affine3d turned = Eigen::Affine3d::Identity();
    if (word.empty()) return turned;
    const bool known = (word.size() == 2 || word.size() == 3) && (word[0] == 'M' || word[0] == 'U') &&
                       (word[1] == 'F' || word[1] == 'N');
    if (!known)
        throw detail::unusable(
            path, "UltrasoundImageOrientation '" + word + "' is none of brightness images; write MF, MN, UF or UN");
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

void require_pixels_of_a_probe(const fs::path& path, const Eigen::Affine3d& to_patient) {
    const Eigen::Vector3d column = to_patient.linear().col(0), row = to_patient.linear().col(1);
    const double across = column.norm(), along = row.norm();
    const auto plausible = [](double mm) { return mm >= smallest_pixel_mm && mm <= largest_pixel_mm; };
    if (!plausible(across) || !plausible(along) || std::abs(column.dot(row)) > most_skew * across * along)
        throw detail::unusable(path, "its pixels are " + rounded(across) + " x " + rounded(along) +
                                         " mm, or skewed, as no probe has them; the transform from Image must take "
                                         "pixels to mm");
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
    std::smatch found;
    const std::regex pattern("\\s" + name + "\\s*=\\s*\"([^\"]*)\"");
    return std::regex_search(element, found, pattern) ? found[1].str() : "";
}

std::string joined(const std::set<std::string>& names) {
    std::string text;
    for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
    return text.empty() ? "none" : text;
}

/// From pixels to the patient's system. A calibration that was given goes before what the file says.
std::optional<Eigen::Affine3d> way_to_patient(const detail::FrameTransforms& transforms, const SweepOptions& options) {
    if (!options.image_to_probe) return transforms.between(image, options.to);
    auto way = transforms.between(probe, options.to);
    if (way) *way = *way * *options.image_to_probe;
    return way;
}

[[noreturn]] void refuse_without_way(const fs::path& path, const std::vector<FrameFields>& frames,
                                     const SweepOptions& options) {
    std::set<std::string> systems;
    for (const FrameFields& frame : frames) systems.merge(frame.transforms.systems());
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
    for (std::size_t at = text.find("<Transform"); at != std::string::npos; at = text.find("<Transform", at + 1)) {
        const std::string element = text.substr(at, text.find('>', at) - at);
        if (attribute(element, "From") == image && attribute(element, "To") == probe)
            return detail::affine_of(path, "transform from Image to Probe", attribute(element, "Matrix"));
    }
    throw detail::unusable(path,
                           "it has no <Transform From=\"Image\" To=\"Probe\" Matrix=\"…\">; give the "
                           "configuration of a calibrated probe");
}

Sweep read_sweep(const fs::path& path, const SweepOptions& options) {
    const SweepHeader header = detail::read_meta_sweep_header(path);
    require_brightness(path, header);
    const Eigen::Affine3d stored = to_marked_far(path, header);
    const std::vector<FrameFields> fields = detail::frame_fields(path, header.frames, header.voxels.size[2]);
    Sweep sweep;
    for (std::size_t n = 0; n < fields.size(); ++n) {
        const FrameFields& frame = fields[n];
        const auto way = way_to_patient(frame.transforms, options);
        if (!frame.image_ok || !way) continue;
        sweep.frames.push_back({static_cast<int>(n), in_patient(*way * stored, options.axes)});
        require_pixels_of_a_probe(path, sweep.frames.back().to_patient);
    }
    if (sweep.frames.empty()) refuse_without_way(path, fields, options);
    if (const std::size_t left_out = fields.size() - sweep.frames.size(); left_out > 0)
        sweep.notes.push_back(std::to_string(left_out) + " of " + std::to_string(fields.size()) +
                              " frames are left out, whose image or place is not OK");
    sweep.pixels = detail::read_stored_voxels(path, header.voxels);
    return sweep;
}

}  // namespace tissuewarp::imaging
