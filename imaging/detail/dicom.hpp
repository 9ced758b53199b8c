#pragma once
/// DICOM images: one series in a folder, or one file of many frames.

#include "imaging/image_io.hpp"

#include <filesystem>

namespace tissuewarp::imaging::detail {

/// True when the file begins as DICOM files do, with or without a preamble.
bool is_dicom_file(const std::filesystem::path& path);

/// Reads the frames of the one series in a folder, or of one file, each from its own words: sorted by position along
/// their common normal, with their own rescale slope and intercept. A segmentation (SEG) becomes a label map of segment
/// numbers, with names, and so does a file of contours (RTSTRUCT; structure_set.hpp). Throws InvalidInput on several series or stacks, frames without a position, missing or doubled
/// slices, slices that do not lie along their common normal (gantry tilt), and overlapping segments; IoError when a
/// file cannot be read.
ReadResult read_dicom(const std::filesystem::path& path);

}  // namespace tissuewarp::imaging::detail
