#pragma once
/// What the header of a NIfTI, NRRD or MetaImage file says, in LPS mm, and what had to be decided on the way.

#include "imaging/detail/segments.hpp"
#include "imaging/detail/stored_voxels.hpp"
#include "imaging/volume.hpp"

#include <Eigen/Core>

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace tissuewarp::imaging::detail {

enum class Format { Nifti, Nrrd, MetaImage };

/// NRRD's free pair that says what a displacement field carries, as 3D Slicer writes it.
inline constexpr const char* field_type_key = "displacement field type";

struct ImageHeader {
    Geometry geometry;  ///< LPS mm
    StoredVoxels voxels;
    Eigen::Matrix3d vector_axes = Eigen::Matrix3d::Identity();  ///< components as stored to LPS mm
    bool converted = false;         ///< lengths, and those of vectors with them, were in another unit than mm
    bool positions = false;         ///< vectors are the places (LPS after `vector_axes`) that voxels go to
    std::vector<Segment> segments;  ///< of a segmentation of 3D Slicer
    std::vector<std::string> notes;
};

/// Of a MetaImage whose third axis counts frames.
struct SweepHeader {
    StoredVoxels voxels;
    std::string orientation, type;              ///< fields UltrasoundImageOrientation and UltrasoundImageType, or empty
    std::map<std::string, std::string> frames;  ///< fields of single frames
};

/// Throws InvalidInput on a file without fields of frames and on another size than columns × rows × frames, and IoError
/// on a damaged header.
SweepHeader read_meta_sweep_header(const std::filesystem::path& path);

/// Throws InvalidInput on what is no volume or has no place in a patient, and IoError on a damaged header.
ImageHeader read_nifti_image_header(const std::filesystem::path& path);
ImageHeader read_nrrd_image_header(const std::filesystem::path& path);
ImageHeader read_meta_image_header(const std::filesystem::path& path);

inline ImageHeader read_image_header(const std::filesystem::path& path, Format format) {
    switch (format) {
        case Format::Nrrd:
            return read_nrrd_image_header(path);
        case Format::MetaImage:
            return read_meta_image_header(path);
        default:
            return read_nifti_image_header(path);
    }
}

}  // namespace tissuewarp::imaging::detail
