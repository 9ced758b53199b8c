#pragma once
/// Writing transforms for ITK, ANTs, 3D Slicer and elastix.

#include "registration/io/point_map.hpp"

namespace tissuewarp::registration {

/// Writes a map as ITK reads it: an .h5 file holds one CompositeTransform (its parts in ITK's order, the field as a
/// DisplacementFieldTransform, components rounded to imaging::displacement_step_mm, float32, compressed), or a single
/// AffineTransform where the map is linear; .tfm and .txt hold that in text. ITK's files have no place for the inverse
/// of a field: whoever needs it writes it as a map of its own. Complete or absent. Throws InvalidInput for a field in
/// .tfm or .txt and for another extension, and IoError (a full disk too).
void write_itk_transform(const PointMap& map, const std::filesystem::path& path);

/// The same of y ↦ y + displacement(y) with this linear part: with_linear_part(), without a second field in memory.
void write_itk_transform(const imaging::Volume& displacement, const Eigen::Affine3d& linear,
                         const std::filesystem::path& path);

/// Four rows of four numbers that multiply columns (x, y, z, 1), LPS mm. Throws IoError.
void write_matrix(const Eigen::Affine3d& map, const std::filesystem::path& path);

}  // namespace tissuewarp::registration
