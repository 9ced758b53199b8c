#pragma once
/// Points and landmarks as text files, and displacement fields read at points.

#include "core/observer.hpp"
#include "imaging/volume.hpp"
#include "meshing/tet_mesh.hpp"

#include <Eigen/Core>

#include <filesystem>
#include <string>
#include <vector>

namespace tissuewarp::apps {

/// Points of a file of points or of a surface, 3 × P, LPS mm. Throws IoError or InvalidInput.
Eigen::Matrix3Xd read_points(const std::filesystem::path& path, Observer& observer);

/// A surface of tissue. Throws IoError, or InvalidInput where its extent cannot be that of tissue in mm.
meshing::SurfaceMesh read_tissue_surface(const std::filesystem::path& path, Observer& observer);

/// Named columns of numbers, all of one length, as CSV with six decimals. Complete or absent; throws IoError.
struct Column {
    std::string name;
    Eigen::VectorXd values;
};
void write_columns(const std::vector<Column>& columns, const std::filesystem::path& path);

/// x, y, z columns of points under a prefix ("pre_" gives pre_x, pre_y, pre_z).
void append_points(std::vector<Column>& columns, const std::string& prefix, const Eigen::Matrix3Xd& points);

/// points + field(points), trilinear. Throws InvalidInput for a field without three components, and where a point lies
/// outside its grid.
Eigen::Matrix3Xd displaced(const Eigen::Matrix3Xd& points, const imaging::Volume& field);

}  // namespace tissuewarp::apps
