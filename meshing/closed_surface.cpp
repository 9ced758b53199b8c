#include "meshing/closed_surface.hpp"

#include "core/errors.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

namespace tissuewarp::meshing {

namespace {

bool less(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end());
}

/// Of each node the first one of equal coordinates, numbered anew; fills `nodes`.
std::vector<int> merged(const Eigen::Matrix3Xd& given, Eigen::Matrix3Xd& nodes) {
    std::vector<int> order(static_cast<std::size_t>(given.cols())), number(order.size());
    std::iota(order.begin(), order.end(), 0);
    std::sort(order.begin(), order.end(), [&](int a, int b) { return less(given.col(a), given.col(b)); });
    nodes.resize(3, given.cols());
    int count = 0;
    for (std::size_t n = 0; n < order.size(); ++n) {
        if (n == 0 || given.col(order[n]) != given.col(order[n - 1])) nodes.col(count++) = given.col(order[n]);
        number[static_cast<std::size_t>(order[n])] = count - 1;
    }
    nodes.conservativeResize(3, count);
    return number;
}

SurfaceMesh without_repeated_nodes(const SurfaceMesh& surface) {
    SurfaceMesh result;
    const std::vector<int> number = merged(surface.nodes, result.nodes);
    result.triangles.resize(3, surface.triangles.cols());
    Eigen::Index count = 0;
    for (Eigen::Index t = 0; t < surface.triangles.cols(); ++t) {
        Eigen::Vector3i corners;
        for (int k = 0; k < 3; ++k) corners[k] = number[static_cast<std::size_t>(surface.triangles(k, t))];
        if (corners[0] != corners[1] && corners[1] != corners[2] && corners[2] != corners[0])
            result.triangles.col(count++) = corners;
    }
    result.triangles.conservativeResize(3, count);
    return result;
}

/// How often an edge is used, from the lower of its nodes to the higher and back.
struct Uses {
    int along = 0, back = 0;
};

std::map<std::pair<int, int>, Uses> uses_of_edges(const SurfaceMesh& surface) {
    std::map<std::pair<int, int>, Uses> edges;
    for (Eigen::Index t = 0; t < surface.triangles.cols(); ++t)
        for (int k = 0; k < 3; ++k) {
            const int a = surface.triangles(k, t), b = surface.triangles((k + 1) % 3, t);
            Uses& uses = edges[{std::min(a, b), std::max(a, b)}];
            ++(a < b ? uses.along : uses.back);
        }
    return edges;
}

/// About the first node, which keeps digits where the body lies far from the origin.
double enclosed_volume(const SurfaceMesh& surface) {
    double sum = 0;
    const Eigen::Vector3d origin = surface.nodes.col(0);
    for (Eigen::Index t = 0; t < surface.triangles.cols(); ++t) {
        const auto at = [&](int k) -> Eigen::Vector3d { return surface.nodes.col(surface.triangles(k, t)) - origin; };
        sum += at(0).cross(at(1)).dot(at(2)) / 6;
    }
    return sum;
}

}  // namespace

ClosedSurface closed_surface(const SurfaceMesh& surface) {
    ClosedSurface result{without_repeated_nodes(surface), 0, {}};
    if (result.mesh.triangle_count() == 0)
        throw InvalidInput("has points and no triangles; give the closed surface of the organ");
    long long open = 0, disagreeing = 0;
    for (const auto& [nodes, uses] : uses_of_edges(result.mesh)) {
        open += (uses.along + uses.back) % 2;
        disagreeing += uses.along != uses.back;
    }
    if (open > 0)
        throw InvalidInput("is not closed: " + std::to_string(open) +
                           " open edges; fill its holes, or make it anew from the segmentation");
    if (disagreeing > 0) {
        result.notes.push_back(std::to_string(disagreeing) +
                               " edges whose triangles disagree on which side is outside; inside is what a ray enters");
        return result;
    }
    const double volume = enclosed_volume(result.mesh);
    if (volume < 0) result.notes.emplace_back("its triangles face inward; they were turned");
    if (volume < 0) result.mesh.triangles.row(1).swap(result.mesh.triangles.row(2));
    result.volume_mm3 = std::abs(volume);
    return result;
}

}  // namespace tissuewarp::meshing
