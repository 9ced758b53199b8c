#pragma once
/// One DICOM series in a folder.

#include "imaging/volume.hpp"

#include <filesystem>

namespace tissuewarp::imaging::detail {

/// Reads the slices of the one series in `folder`, ordered by position along the slice normal, rescale slope and
/// intercept applied. Throws InvalidInput on several series, missing or doubled slices, or slices that do not lie along
/// their common normal (gantry tilt), and IoError when a file cannot be read.
Volume read_dicom_series(const std::filesystem::path& folder);

}  // namespace tissuewarp::imaging::detail
