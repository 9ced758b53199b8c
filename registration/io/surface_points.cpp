#include "registration/io/surface_points.hpp"

#include "core/errors.hpp"
#include "meshing/mesh_io.hpp"
#include "registration/io/extent.hpp"

#include <cmath>
#include <sstream>

namespace tissuewarp::registration {

namespace {

constexpr Eigen::Index least_points = 10;

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
    detail::require_millimetres(points, "the intraoperative surface is");
}

SurfacePoints read_surface_points(const std::filesystem::path& path, double deviation_mm, Observer& observer) {
    const meshing::Surface file = meshing::read_surface(path, observer);
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
