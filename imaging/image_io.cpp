#include "imaging/image_io.hpp"

#include "core/atomic_file.hpp"
#include "core/errors.hpp"
#include "imaging/detail/dicom_series.hpp"
#include "imaging/detail/gzip.hpp"
#include "imaging/detail/itk_image_io.hpp"
#include "imaging/detail/nifti_header.hpp"
#include "imaging/detail/text_headers.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <sstream>

namespace tissuewarp::imaging {
namespace fs = std::filesystem;

namespace {

std::string lower_case_name(const fs::path& path) {
    std::string name = path.filename().string();
    std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::tolower(c); });
    return name;
}

detail::Format format_of(const fs::path& path, const char* verb) {
    const std::string name = lower_case_name(path);
    for (const char* extension : {".nii", ".nii.gz"})
        if (name.ends_with(extension)) return detail::Format::Nifti;
    for (const char* extension : {".nrrd", ".nhdr"})
        if (name.ends_with(extension)) return detail::Format::Nrrd;
    for (const char* extension : {".mha", ".mhd"})
        if (name.ends_with(extension)) return detail::Format::MetaImage;
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

/// Vectors of intent 1006 are in NIfTI's RAS world: x and y change sign in LPS.
void turn_ras_vectors(Volume& volume) {
    const auto [nx, ny, nz] = volume.geometry.size;
    for (int k = 0; k < nz; ++k) {
        cv::Mat components(nx * ny, 3, volume.voxels.depth(), volume.voxels.ptr(k));
        components.colRange(0, 2) *= -1.0;
    }
}

/// The geometry that a NIfTI matrix (voxel to RAS mm) states.
Geometry geometry_of_nifti(const Eigen::Matrix4d& matrix, const std::array<int, 3>& size) {
    const Eigen::Vector3d ras_to_lps(-1.0, -1.0, 1.0);
    const Eigen::Matrix3d axes = ras_to_lps.asDiagonal() * matrix.topLeftCorner<3, 3>();
    Geometry geometry;
    geometry.size = size;
    geometry.spacing = axes.colwise().norm().transpose();
    geometry.direction = axes * geometry.spacing.cwiseInverse().asDiagonal();
    geometry.origin = ras_to_lps.cwiseProduct(matrix.topRightCorner<3, 1>());
    return geometry;
}

void note_nifti_header(const detail::NiftiHeader& header, ReadResult& result) {
    const Geometry& used = result.volume.geometry;
    std::ostringstream note;
    note.precision(3);
    if (header.qform_code <= 0 && header.sform_code <= 0) {
        note << "neither qform nor sform is set: the header does not say where the image lies in the patient";
        result.notes.push_back(note.str());
    } else if (header.qform_code > 0 && header.sform_code > 0) {
        const double to_sform = grid_distance(used, geometry_of_nifti(header.sform, used.size));
        const double to_qform = grid_distance(used, geometry_of_nifti(header.qform, used.size));
        if (std::max(to_sform, to_qform) > 1e-2) {
            const bool took_sform = to_sform <= to_qform;
            note << "sform and qform disagree by up to " << std::max(to_sform, to_qform) << " voxels; the "
                 << (took_sform ? "sform" : "qform") << " is used, as ITK does";
            result.notes.push_back(note.str());
        }
    }
    if (header.space_unit == 1 || header.space_unit == 3)
        result.notes.push_back(std::string("lengths are given in ") +
                               (header.space_unit == 1 ? "metres" : "micrometres") + " and were converted to mm");
    if (result.volume.channels() != 3) return;
    if (header.intent_code == detail::nifti_intent_displacement) {
        turn_ras_vectors(result.volume);
        result.notes.emplace_back(
            "NIfTI intent 1006 (displacement): components are taken as RAS and turned to LPS, as ITK 5.3 and later do; "
            "a file whose components are LPS already must carry intent 1007");
    } else if (header.intent_code != detail::nifti_intent_vector) {
        result.notes.push_back("vectors of NIfTI intent " + std::to_string(header.intent_code) +
                               " are taken as LPS mm");
    }
}

void note_nrrd_header(const detail::TextHeader& header, ReadResult& result) {
    std::string space = header.value("space");
    std::transform(space.begin(), space.end(), space.begin(), [](unsigned char c) { return std::tolower(c); });
    const bool lps = space == "lps" || space == "left-posterior-superior";
    if (result.volume.channels() == 3 && !lps)
        result.notes.push_back("vectors of an NRRD file of space '" + space + "' are taken as LPS mm as they are");
    if (space.empty()) result.notes.emplace_back("the NRRD header names no space: its axes are taken as LPS");
}

template <class T>
void copy_labels(const Volume& image, Volume& labels, const fs::path& path) {
    const T* source = image.voxels.ptr<T>();
    int* target = labels.voxels.ptr<int>();
    const auto count = static_cast<std::size_t>(image.geometry.voxel_count());
    for (std::size_t i = 0; i < count; ++i) {
        const auto value = static_cast<double>(source[i]);
        if (value < 0.0 || value != std::floor(value) || value > std::numeric_limits<int>::max()) {
            std::ostringstream message;
            message << "cannot use '" << path.string() << "' as a label map: it holds the value " << value
                    << "; labels are whole numbers from 0 on, so give a segmentation, resampled with nearest neighbour";
            throw InvalidInput(message.str());
        }
        target[i] = static_cast<int>(value);
    }
}

/// Writes one file through ITK and makes sure that all of it arrived: ITK does not notice a full disk.
void write_whole(const Volume& volume, const fs::path& temporary, detail::Format format, const fs::path& path) {
    detail::write_through_itk(volume, temporary, format);
    try {
        detail::require_sound_file(temporary, format);
    } catch (const Error&) {
        throw IoError("cannot write '" + path.string() + "': the file did not arrive whole; free space on the disk");
    }
}

void write_compressed_nifti(const Volume& volume, const fs::path& path, const fs::path& temporary) {
    // ITK would deflate on one thread at level 6, which takes many seconds on a field; the plain file is packed here.
    fs::path plain_name = path;
    plain_name.replace_extension();
    const AtomicFile plain(plain_name);
    write_whole(volume, plain.path(), detail::Format::Nifti, path);
    const bool integers = volume.voxels.depth() < CV_32F;
    detail::gzip_file(plain.path(), temporary, integers ? 4 : 1);
}

}  // namespace

ReadResult read_volume_with_notes(const fs::path& path) {
    std::error_code failure;
    const fs::file_status status = fs::status(path, failure);
    if (!fs::exists(status)) throw IoError("'" + path.string() + "' does not exist; check the path");
    ReadResult result;
    if (fs::is_directory(status)) {
        result.volume = detail::read_dicom_series(path);
    } else {
        const detail::Format format = format_of(path, "read");
        detail::require_sound_file(path, format);
        result.volume = detail::read_through_itk(path, format);
        if (format == detail::Format::Nifti) note_nifti_header(detail::read_nifti_header(path), result);
        if (format == detail::Format::Nrrd) note_nrrd_header(detail::read_nrrd_header(path), result);
    }
    require_finite(result.volume, path);
    return result;
}

Volume read_volume(const fs::path& path) {
    return read_volume_with_notes(path).volume;
}

Volume read_labels(const fs::path& path) {
    const Volume image = read_volume(path);
    if (image.channels() != 1)
        throw InvalidInput("cannot use '" + path.string() + "' as a label map: it holds vectors; give a segmentation");
    Volume labels(image.geometry, CV_32S);
    switch (image.voxels.depth()) {
        case CV_8U:
            copy_labels<std::uint8_t>(image, labels, path);
            break;
        case CV_8S:
            copy_labels<std::int8_t>(image, labels, path);
            break;
        case CV_16U:
            copy_labels<std::uint16_t>(image, labels, path);
            break;
        case CV_16S:
            copy_labels<std::int16_t>(image, labels, path);
            break;
        case CV_32S:
            copy_labels<std::int32_t>(image, labels, path);
            break;
        case CV_32F:
            copy_labels<float>(image, labels, path);
            break;
        default:
            copy_labels<double>(image, labels, path);
            break;
    }
    return labels;
}

void write_volume(const Volume& volume, const fs::path& path) {
    const detail::Format format = format_of(path, "write");
    const std::string name = lower_case_name(path);
    if (name.ends_with(".nhdr") || name.ends_with(".mhd"))
        throw InvalidInput("cannot write '" + path.string() + "': this format makes two files; use .nrrd or .mha");
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
        write_compressed_nifti(volume, path, file.path());
    } else {
        write_whole(volume, file.path(), format, path);
    }
    file.commit();
}

}  // namespace tissuewarp::imaging
