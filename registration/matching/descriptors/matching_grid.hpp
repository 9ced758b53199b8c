#pragma once
/// The working grids of feature selection and block matching, and the checks that stand before them.

#include "imaging/volume.hpp"

#include <Eigen/Core>

namespace tissuewarp::registration::detail {

/// Throws InvalidInput unless the volume is scalar and every voxel is finite. `name` opens the message.
void require_finite(const imaging::Volume& image, const char* name);

/// Whether a point (LPS mm) lies in the box of the voxels, half a voxel about the outermost centres included.
bool in_image(const imaging::Geometry& grid, const Eigen::Vector3d& point);

/// An isotropic grid over the bounding box of points (3 × N, LPS mm) along given axes, `margin_mm` wider.
imaging::Geometry grid_about(const Eigen::Matrix3Xd& points, const Eigen::Matrix3d& direction, double spacing_mm,
                             double margin_mm);

/// An isotropic grid over the part of the image about the mask's voxels != 0, along the image's axes, no wider than the
/// image, at `spacing_mm` or the image's own least spacing, whichever is less. Throws InvalidInput when the mask is
/// empty or off the image.
imaging::Geometry grid_about_mask(const imaging::Geometry& image, const imaging::Volume& mask, double margin_mm,
                                  double spacing_mm);

}  // namespace tissuewarp::registration::detail
