#pragma once
/// Transforms of other programs, as maps of points.

#include "imaging/field_type.hpp"
#include "imaging/volume.hpp"

#include <Eigen/Geometry>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::registration {

/// Where a point of the fixed image is found in the moving one, as resamplers ask: LPS mm. x = after (z + field(z)),
/// z = before y.
struct PointMap {
    Eigen::Affine3d before = Eigen::Affine3d::Identity();
    std::optional<imaging::Volume> field;  ///< displacements, three channels float32, LPS mm
    Eigen::Affine3d after = Eigen::Affine3d::Identity();
    /// Modeling where the file says that it maps the other way, from moving points to fixed ones.
    imaging::FieldType type = imaging::FieldType::Resampling;
    std::vector<std::string> notes{};  ///< what the reader of the field had to decide
};

/// Reads transforms of ITK as ANTs and 3D Slicer write them: text (.tfm, .txt), HDF5 (.h5) and Matlab (.mat)
/// with translations, rigid, similarity and affine transforms, compositions of them with a displacement field among
/// them; a displacement field as an image; and four rows of four numbers. Each maps points of the fixed image to the
/// moving one, LPS mm, unless an NRRD file says otherwise (`type`). Throws IoError or, naming what it found,
/// InvalidInput.
PointMap read_point_map(const std::filesystem::path& path);

}  // namespace tissuewarp::registration
