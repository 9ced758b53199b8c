#pragma once
/// The header of NIfTI-1 and NIfTI-2 as it lies in the file.

#include <Eigen/Core>

#include <array>
#include <filesystem>
#include <string>

namespace tissuewarp::imaging::detail {

struct NiftiHeader {
    bool swapped = false;            ///< the file's byte order is not this machine's
    bool separate_voxels = false;    ///< a pair .hdr and .img
    std::array<long long, 8> dim{};  ///< dim[0] is the number of dimensions
    int intent_code = 0;
    double intent_parameter = 0.0;  ///< intent_p1
    std::string intent_name;
    int datatype = 0, bits_per_voxel = 0;
    std::array<double, 8> pixdim{};  ///< pixdim[0] is the handedness of the qform
    double data_offset = 0.0;        ///< byte where voxels begin, in the unpacked file
    double slope = 0.0, intercept = 0.0;
    int space_unit = 0;  ///< 0 unknown, 1 metre, 2 millimetre, 3 micrometre
    int qform_code = 0, sform_code = 0;
    Eigen::Matrix4d qform = Eigen::Matrix4d::Identity();  ///< voxel to RAS, in the header's unit
    Eigen::Matrix4d sform = Eigen::Matrix4d::Identity();  ///< voxel to RAS, in the header's unit
};

constexpr int nifti_intent_displacement = 1006;
constexpr int nifti_intent_vector = 1007;

/// Parses the first bytes of a file, packed by gzip or not, of either byte order. Throws IoError when they are no NIfTI
/// header, and InvalidInput on one of ANALYZE 7.5, which does not say where left is.
NiftiHeader read_nifti_header(const std::filesystem::path& path);

}  // namespace tissuewarp::imaging::detail
