#include "registration/surface_points.hpp"

#include "core/errors.hpp"
#include "meshing/mesh_io.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <vector>

namespace tissuewarp::registration {

namespace {

constexpr Eigen::Index least_points = 10;
constexpr double least_extent_mm = 3, most_extent_mm = 2000;

/// Twice the median distance from the median point, mm: stray points do not count.
double extent_of(const Eigen::Matrix3Xd& points) {
    const auto median = [](std::vector<double> values) {
        const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
        std::nth_element(values.begin(), middle, values.end());
        return *middle;
    };
    Eigen::Vector3d centre;
    for (int axis = 0; axis < 3; ++axis) {
        const Eigen::RowVectorXd row = points.row(axis);
        centre[axis] = median({row.begin(), row.end()});
    }
    const Eigen::RowVectorXd distances = (points.colwise() - centre).colwise().norm();
    return 2 * median({distances.begin(), distances.end()});
}

}  // namespace

void require_usable(const SurfacePoints& surface) {
    const auto refuse = [](const auto&... parts) {
        std::ostringstream text;
        text << "the intraoperative surface ";
        (text << ... << parts);
        throw InvalidInput(text.str());
    };
    const Eigen::Matrix3Xd& points = surface.points;
    if (points.cols() < least_points) refuse("has ", points.cols(), " points; at least ", least_points, " are needed");
    if (!points.allFinite()) refuse("has points that are not finite; remove them");
    if (surface.normals.cols() != 0 && surface.normals.cols() != points.cols())
        refuse("has ", surface.normals.cols(), " normals for ", points.cols(), " points; give all or none");
    for (Eigen::Index n = 0; n < surface.normals.cols(); ++n)
        if (!(std::abs(surface.normals.col(n).norm() - 1) < 1e-3))
            refuse("has a normal of length ", surface.normals.col(n).norm(), " at point ", n, "; unit normals or none");
    if (!(surface.deviation_mm > 0) || !std::isfinite(surface.deviation_mm))
        refuse("has a standard deviation of ", surface.deviation_mm, " mm; a positive number is needed");
    const double extent = extent_of(points);
    if (extent < least_extent_mm)
        refuse("is about ", extent, " mm across; coordinates in mm are needed, are these in metres?");
    if (extent > most_extent_mm)
        refuse("is about ", extent, " mm across; coordinates in mm are needed, are these in micrometres?");
}

SurfacePoints read_surface_points(const std::filesystem::path& path, double deviation_mm) {
    const meshing::Surface file = meshing::read_surface(path);
    SurfacePoints surface{file.mesh.nodes, file.normals, deviation_mm};
    if (surface.normals.cols() == 0 && file.mesh.triangle_count() > 0)
        surface.normals = meshing::node_normals(file.mesh);
    // A normal of zero says that it is not known: then all are estimated.
    if (surface.normals.cols() > 0 && surface.normals.colwise().norm().minCoeff() < 0.5) surface.normals.resize(3, 0);
    try {
        require_usable(surface);
    } catch (const InvalidInput& problem) {
        throw InvalidInput(path.string() + ": " + problem.what());
    }
    return surface;
}

}  // namespace tissuewarp::registration
