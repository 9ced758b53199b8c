#pragma once
/// From the buffer of an itk::ImageIOBase to an OpenCV matrix. Included by the translation units that include ITK.

#include "imaging/volume.hpp"

#include <itkImageIOBase.h>

#include <filesystem>

namespace tissuewarp::imaging::detail {

/// Reads what `io` has been pointed at (ReadImageInformation done). Integers wider than int32 become int32 when every
/// value fits and float64 otherwise. Throws InvalidInput on more than one volume and on other voxel types.
cv::Mat read_voxels(itk::ImageIOBase& io, const Geometry& geometry, const std::filesystem::path& path);

/// Size, origin, spacing and direction of the first three axes.
Geometry geometry_of(const itk::ImageIOBase& io);

/// An ITK exception's message on one line, without ITK's file names and line numbers.
std::string one_line(const itk::ExceptionObject& error);

}  // namespace tissuewarp::imaging::detail
