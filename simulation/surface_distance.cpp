#include "simulation/surface_distance.hpp"

#include "core/errors.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <string>

namespace tissuewarp::simulation {
namespace {

using Eigen::Vector3d;

/// Distance from the origin to the triangle a, b, c (Ericson, Real-Time Collision Detection, 2005, section 5.1.5).
double distance_to_triangle(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
    const Vector3d normal = (b - a).cross(c - a);
    const auto outside = [&](const Vector3d& from, const Vector3d& to) {
        return (to - from).cross(-from).dot(normal) < 0;
    };
    const auto to_edge = [](const Vector3d& from, const Vector3d& to) {
        const Vector3d along = to - from;
        const double length = along.squaredNorm();
        const double t = length > 0 ? std::clamp(-from.dot(along) / length, 0.0, 1.0) : 0.0;
        return (from + t * along).norm();
    };
    if (outside(a, b) || outside(b, c) || outside(c, a) || !(normal.norm() > 0))
        return std::min({to_edge(a, b), to_edge(b, c), to_edge(c, a)});
    return std::abs(a.dot(normal)) / normal.norm();
}

/// Solid angle of the triangle seen from the origin (van Oosterom and Strackee 1983, eq. 8).
double solid_angle(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    return 2 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
}

}  // namespace

SurfaceDistance::SurfaceDistance(const meshing::SurfaceMesh& surface) : surface_(surface) {
    std::map<std::pair<int, int>, int> edges;  // directed, less the opposite direction
    double volume = 0;
    for (int t = 0; t < surface.triangle_count(); ++t) {
        const Eigen::Vector3i face = surface.triangles.col(t);
        for (int k = 0; k < 3; ++k) {
            const int from = face[k], to = face[(k + 1) % 3];
            edges[std::minmax(from, to)] += from < to ? 1 : -1;
        }
        volume += surface.nodes.col(face[0]).dot(
            Vector3d(surface.nodes.col(face[1])).cross(Vector3d(surface.nodes.col(face[2]))));
    }
    const bool open = std::any_of(edges.begin(), edges.end(), [](const auto& edge) { return edge.second != 0; });
    if (edges.empty() || open)
        throw InvalidInput(
            "the surface of an obstacle is not closed: an edge has a triangle on one side only, or "
            "triangles that face different ways; close it and merge equal points");
    if (!(volume > 0)) throw InvalidInput("the triangles of an obstacle face inwards; turn them round");
}

double SurfaceDistance::operator()(const Vector3d& point) const {
    double nearest = std::numeric_limits<double>::infinity(), angle = 0;
    for (int t = 0; t < surface_.triangle_count(); ++t) {
        const Eigen::Vector3i face = surface_.triangles.col(t);
        const Vector3d a = surface_.nodes.col(face[0]) - point, b = surface_.nodes.col(face[1]) - point;
        const Vector3d c = surface_.nodes.col(face[2]) - point;
        nearest = std::min(nearest, distance_to_triangle(a, b, c));
        angle += solid_angle(a, b, c);
    }
    return std::abs(angle) > 2 * std::numbers::pi ? -nearest : nearest;
}

}  // namespace tissuewarp::simulation
