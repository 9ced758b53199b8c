#include "imaging/image_io.hpp"

#include "core/atomic_file.hpp"
#include "core/file_message.hpp"
#include "imaging/detail/dicom.hpp"
#include "imaging/detail/gzip.hpp"
#include "imaging/detail/header_checks.hpp"
#include "imaging/detail/image_header.hpp"
#include "imaging/detail/itk_image_io.hpp"
#include "imaging/detail/nifti_bytes.hpp"
#include "imaging/detail/structure_set.hpp"
#include "imaging/detail/text_headers.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <optional>
#include <sstream>

namespace tissuewarp::imaging {
namespace fs = std::filesystem;

namespace {

std::string lower_case_name(const fs::path& path) {
    std::string name = path.filename().string();
    std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::tolower(c); });
    return name;
}

std::optional<detail::Format> format_named(const std::string& name) {
    for (const char* extension : {".nii", ".nii.gz", ".hdr", ".hdr.gz", ".img", ".img.gz"})
        if (name.ends_with(extension)) return detail::Format::Nifti;
    for (const char* extension : {".nrrd", ".nhdr"})
        if (name.ends_with(extension)) return detail::Format::Nrrd;
    for (const char* extension : {".mha", ".mhd"})
        if (name.ends_with(extension)) return detail::Format::MetaImage;
    return std::nullopt;
}

detail::Format format_of(const fs::path& path, const char* verb) {
    if (const auto format = format_named(lower_case_name(path))) return *format;
    throw InvalidInput(std::string("cannot ") + verb + " '" + path.string() +
                       "': the extension names no known format; use .nii.gz, .nii, .nrrd, .mha or, to read, the folder "
                       "of a DICOM series");
}

/// Position of the first value that is not finite, or the number of values.
template <class T>
std::size_t first_not_finite(const T* values, std::size_t count) {
    return tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, count, 1 << 16), count,
        [&](const tbb::blocked_range<std::size_t>& range, std::size_t found) {
            for (std::size_t i = range.begin(); i < range.end() && i < found; ++i)
                if (!std::isfinite(values[i])) return i;
            return found;
        },
        [](std::size_t a, std::size_t b) { return std::min(a, b); });
}

void require_finite(const Volume& volume, const fs::path& path) {
    const auto channels = static_cast<std::size_t>(volume.channels());
    const std::size_t count = volume.voxels.total() * channels;
    std::size_t found = count;
    if (volume.voxels.depth() == CV_32F) found = first_not_finite(volume.voxels.ptr<float>(), count);
    if (volume.voxels.depth() == CV_64F) found = first_not_finite(volume.voxels.ptr<double>(), count);
    if (found == count) return;
    const auto voxel = static_cast<long long>(found / channels);
    const auto [nx, ny, nz] = volume.geometry.size;
    const double value =
        volume.voxels.depth() == CV_32F ? volume.voxels.ptr<float>()[found] : volume.voxels.ptr<double>()[found];
    std::ostringstream message;
    message << "cannot use '" << path.string() << "': voxel (" << voxel % nx << ", " << voxel / nx % ny << ", "
            << voxel / nx / ny << ") is " << value << "; replace values that are not finite, for instance by 0";
    throw InvalidInput(message.str());
}

/// Components to LPS mm; positions become displacements from where the voxels lie.
template <class T>
void turn_vectors(Volume& volume, const detail::ImageHeader& header) {
    const auto [nx, ny, nz] = volume.geometry.size;
    tbb::parallel_for(0, nz, [&, nx = nx, ny = ny](int k) {
        T* components = volume.voxels.ptr<T>(k);
        for (int j = 0; j < ny; ++j)
            for (int i = 0; i < nx; ++i, components += 3) {
                Eigen::Vector3d vector =
                    header.vector_axes * Eigen::Vector3d(components[0], components[1], components[2]);
                if (header.positions) vector -= volume.geometry.point({1.0 * i, 1.0 * j, 1.0 * k});
                for (int c = 0; c < 3; ++c) components[c] = static_cast<T>(vector[c]);
            }
    });
}

void turn_vectors(ReadResult& result, const detail::ImageHeader& header) {
    if (result.volume.channels() != 3) return;
    if (header.vector_axes.isIdentity(1e-6) && !header.positions) return;
    if (header.converted)
        result.notes.emplace_back(
            "its vectors are taken in the unit that the header states for its space, and were "
            "converted to mm too");
    if (result.volume.voxels.depth() < CV_32F) result.volume = result.volume.as(CV_32F);
    if (result.volume.voxels.depth() == CV_32F)
        turn_vectors<float>(result.volume, header);
    else
        turn_vectors<double>(result.volume, header);
}

/// One value, or three that are no colours. Layers of a segmentation may be any number.
void require_scalar_or_vector(const detail::ImageHeader& header, const fs::path& path) {
    const int channels = header.voxels.channels;
    const bool colours = channels == 3 && header.voxels.type == detail::Scalar::UInt8;
    if (!header.segments.empty() || channels == 1 || (channels == 3 && !colours)) return;
    throw InvalidInput("cannot use '" + path.string() + "': its voxels hold " + std::to_string(channels) +
                       (colours ? " bytes, as colours do" : " values") +
                       "; give one grey value, or a vector of three floating-point components");
}

ReadResult read_file(const fs::path& path) {
    const detail::ImageHeader header = detail::read_image_header(path, format_of(path, "read"));
    require_scalar_or_vector(header, path);
    require_valid(header.geometry, path.c_str());
    ReadResult result;
    result.volume = {header.geometry, detail::read_stored_voxels(path, header.voxels)};
    result.notes = header.notes;
    if (header.segments.empty()) {
        turn_vectors(result, header);
        return result;
    }
    detail::SegmentMap map = detail::collapse_layers(result.volume, header.segments, path);
    result.volume = map.labels;
    result.label_names = std::move(map.names);
    result.notes.insert(result.notes.end(), map.notes.begin(), map.notes.end());
    return result;
}

/// Writes one file through ITK and makes sure that all of it arrived: ITK does not notice a full disk, and knows its
/// formats by small letters only.
void write_whole(const Volume& volume, const fs::path& temporary, detail::Format format, const fs::path& path,
                 std::optional<FieldType> type = {}) {
    fs::path small_letters = temporary;
    small_letters.replace_extension(lower_case_name(temporary.extension()));
    const AtomicFile file(small_letters);
    detail::write_through_itk(volume, file.path(), format, type);
    try {
        detail::require_whole(file.path(), detail::read_image_header(file.path(), format).voxels);
    } catch (const Error&) {
        throw IoError("cannot write '" + path.string() + "': the file did not arrive whole; free space on the disk");
    }
    fs::rename(file.path(), temporary);
}

void write_compressed_nifti(const Volume& volume, const fs::path& path, const fs::path& temporary,
                            std::optional<double> step) {
    // ITK would deflate on one thread at level 6, which takes many seconds on a field.
    fs::path plain_name = path;
    plain_name.replace_extension().replace_extension(".nii");  // ITK knows small letters only
    const detail::NiftiBytes bytes(volume, step, plain_name);
    const auto source = [&](auto first, auto count, unsigned char* target) { bytes.copy(first, count, target); };
    detail::write_gzip(source, bytes.size(), temporary);
}

/// `step`: to which values of float32 are rounded.
void write_checked(const Volume& volume, const fs::path& path, std::optional<FieldType> type,
                   std::optional<double> step) {
    const detail::Format format = format_of(path, "write");
    const std::string name = lower_case_name(path);
    for (const char* pair : {".nhdr", ".mhd", ".hdr", ".hdr.gz", ".img", ".img.gz"})
        if (name.ends_with(pair))
            throw InvalidInput("cannot write '" + path.string() +
                               "': this format makes two files; use .nii.gz, .nrrd or .mha");
    if (volume.empty() || (volume.channels() != 1 && volume.channels() != 3))
        throw InvalidInput("cannot write '" + path.string() + "': a volume of " + std::to_string(volume.channels()) +
                           " components; one or three are written");
    require_valid(volume.geometry, path.c_str());
    if (const auto& size = volume.geometry.size; *std::min_element(size.begin(), size.end()) < 2)
        throw InvalidInput(
            "cannot write '" + path.string() +
            "': the volume is one voxel thick, which formats store as two-dimensional; keep two or more");
    if (!path.parent_path().empty() && !fs::is_directory(path.parent_path()))
        throw IoError("cannot write '" + path.string() + "': the folder does not exist; create it first");
    AtomicFile file(path);
    if (name.ends_with(".nii.gz")) {
        write_compressed_nifti(volume, path, file.path(), step);
    } else {
        write_whole(step ? rounded(volume, *step) : volume, file.path(), format, path, type);
    }
    file.commit();
}

}  // namespace

bool is_image(const fs::path& path) {
    std::error_code ignored;
    return fs::is_directory(path, ignored) || format_named(lower_case_name(path)) || detail::is_dicom_file(path);
}

namespace {

ReadResult read_checked(const fs::path& path) {
    std::error_code failure;
    const fs::file_status status = fs::status(path, failure);
    if (!fs::exists(status)) throw IoError("'" + path.string() + "' does not exist; check the path");
    const bool dicom =
        fs::is_directory(status) || (!format_named(lower_case_name(path)) && detail::is_dicom_file(path));
    ReadResult result = dicom ? detail::read_dicom(path) : read_file(path);
    require_finite(result.volume, path);
    return result;
}

}  // namespace

ReadResult read_volume_with_notes(const fs::path& path) {
    return naming(path, [&] { return read_checked(path); });
}

Volume read_volume(const fs::path& path) {
    return read_volume_with_notes(path).volume;
}

bool is_structure_set(const fs::path& path) {
    std::error_code ignored;
    return fs::is_regular_file(path, ignored) && !format_named(lower_case_name(path)) && detail::is_dicom_file(path) &&
           detail::read_structure_set(path).has_value();
}

ReadResult read_structures_on(const fs::path& path, const Geometry& image) {
    return naming(path, [&] {
        const auto set = detail::read_structure_set(path);
        if (!set) throw InvalidInput("is no structure set (RTSTRUCT)");
        return detail::labels_of(*set, path, &image);
    });
}

void write_volume(const Volume& volume, const fs::path& path) {
    write_checked(volume, path, {}, {});
}

Volume rounded(const Volume& field, double step) {
    Volume result(field.geometry, field.voxels.type());
    const auto channels = static_cast<std::size_t>(field.channels());
    const auto per_slice = static_cast<std::size_t>(field.geometry.size[0] * field.geometry.size[1]) * channels;
    tbb::parallel_for(0, field.geometry.size[2], [&](int k) {
        const auto* source = field.voxels.ptr<float>(k);
        auto* target = result.voxels.ptr<float>(k);
        for (std::size_t i = 0; i < per_slice; ++i)
            target[i] = static_cast<float>(std::nearbyint(source[i] / step) * step);
    });
    return result;
}

void write_displacement_field(const Volume& field, const fs::path& path, FieldType type) {
    if (field.voxels.type() != CV_32FC3)
        throw InvalidInput("cannot write '" + path.string() + "': a displacement field has three float32 components");
    write_checked(field, path, type, displacement_step_mm);
}

std::optional<FieldType> stated_field_type(const fs::path& path) {
    if (format_named(lower_case_name(path)) != detail::Format::Nrrd || fs::is_directory(path)) return std::nullopt;
    const detail::TextHeader header = naming(path, [&] { return detail::read_nrrd_header(path); });
    const auto stated = header.comments.find(detail::field_type_key);
    if (stated == header.comments.end()) return std::nullopt;
    const std::string word = detail::lower_case(detail::trimmed(stated->second));
    for (const FieldType type : {FieldType::Resampling, FieldType::Modeling})
        if (word == name_of(type)) return type;
    throw InvalidInput("'" + path.string() + "' says '" + detail::field_type_key + ":=" + word.substr(0, 40) +
                       "'; correct it to resampling or modeling");
}

}  // namespace tissuewarp::imaging
