#pragma once
/// The NIfTI-1 header as it lies in the file: what ITK replaces in silence or does not tell.

#include <Eigen/Core>

#include <array>
#include <filesystem>
#include <string>

namespace tissuewarp::imaging::detail {

struct NiftiHeader {
    bool swapped = false;      ///< the file's byte order is not this machine's
    std::array<int, 8> dim{};  ///< dim[0] is the number of dimensions
    int intent_code = 0;
    int datatype = 0, bits_per_voxel = 0;
    std::array<float, 8> pixdim{};  ///< pixdim[0] is the handedness of the qform
    float data_offset = 0.0F;       ///< byte where voxels begin, in the unpacked file
    float slope = 0.0F, intercept = 0.0F;
    int space_unit = 0;  ///< 0 unknown, 1 metre, 2 millimetre, 3 micrometre
    int qform_code = 0, sform_code = 0;
    Eigen::Matrix4d qform = Eigen::Matrix4d::Identity();  ///< voxel to RAS mm
    Eigen::Matrix4d sform = Eigen::Matrix4d::Identity();  ///< voxel to RAS mm
};

constexpr int nifti_intent_displacement = 1006;
constexpr int nifti_intent_vector = 1007;

/// Parses the first 348 bytes of a .nii or .nii.gz of either byte order. Throws IoError when they are no NIfTI-1
/// header.
NiftiHeader read_nifti_header(const std::filesystem::path& path);

}  // namespace tissuewarp::imaging::detail
