#pragma once
/// The voxels of a NIfTI-1 file. ITK's reader turns values that are not finite into 0 and does not reach the checksum
/// of a gzip file, so that damaged images pass as good ones; voxels are therefore read here, and geometry through ITK.

#include "imaging/detail/nifti_header.hpp"

#include <opencv2/core.hpp>

namespace tissuewarp::imaging::detail {

/// Reads the scalar or three-component (5-D, dim[5] = 3) volume that `header` describes, scaled by slope and intercept
/// (then float32, float64 for integers of 32 bits and more). Throws IoError on a truncated or damaged file,
/// InvalidInput on a voxel type other than plain integers and floating point.
cv::Mat read_nifti_voxels(const std::filesystem::path& path, const NiftiHeader& header);

}  // namespace tissuewarp::imaging::detail
