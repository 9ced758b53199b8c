#include "meshing/search/surface_tree.hpp"

#include "core/errors.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace tissuewarp::meshing {

namespace {

constexpr int leaf = 4;
constexpr std::size_t deepest = 64;  // halving by count: 2⁶⁴ triangles

Eigen::Matrix3Xd unit_face_normals(const meshing::SurfaceMesh& surface) {
    Eigen::Matrix3Xd normals(3, surface.triangle_count());
    for (int t = 0; t < surface.triangle_count(); ++t) {
        const Eigen::Vector3d a = surface.nodes.col(surface.triangles(0, t)),
                              b = surface.nodes.col(surface.triangles(1, t)),
                              c = surface.nodes.col(surface.triangles(2, t));
        normals.col(t) = (b - a).cross(c - a).normalized();
    }
    return normals;
}

bool passes(const NormalGate& gate, const Eigen::Vector3d& normal) {
    const double cosine = gate.normal.dot(normal);
    return (gate.oriented ? cosine : std::abs(cosine)) >= gate.least_cosine;
}

}  // namespace

SurfaceTree::SurfaceTree(const meshing::SurfaceMesh& surface)
    : surface_(surface),
      node_normals_(meshing::node_normals(surface)),
      face_normals_(unit_face_normals(surface)),
      order_(static_cast<std::size_t>(surface.triangle_count())) {
    if (order_.empty()) throw InvalidInput("a surface without triangles has no closest point");
    std::iota(order_.begin(), order_.end(), 0);
    Eigen::Matrix3Xd centres(3, surface.triangle_count());
    for (int t = 0; t < surface.triangle_count(); ++t)
        centres.col(t) = surface.nodes(Eigen::all, surface.triangles.col(t)).rowwise().mean();
    build(0, surface.triangle_count(), centres);
}

void SurfaceTree::build(int first, int count, const Eigen::Matrix3Xd& centres) {
    const std::size_t here = boxes_.size();
    boxes_.emplace_back();
    Eigen::AlignedBox3d extent, middles;
    for (int n = first; n < first + count; ++n) {
        const int triangle = order_[static_cast<std::size_t>(n)];
        for (const int node : surface_.triangles.col(triangle))
            extent.extend(Eigen::Vector3d(surface_.nodes.col(node)));
        middles.extend(Eigen::Vector3d(centres.col(triangle)));
    }
    boxes_[here].extent = extent;
    if (count <= leaf) {
        boxes_[here].first = first;
        boxes_[here].count = count;
        return;
    }
    Eigen::Index axis = 0;
    middles.sizes().maxCoeff(&axis);
    const auto at = order_.begin() + first;
    std::nth_element(at, at + count / 2, at + count, [&](int a, int b) {
        return centres(axis, a) != centres(axis, b) ? centres(axis, a) < centres(axis, b) : a < b;
    });
    build(first, count / 2, centres);
    boxes_[here].right = static_cast<int>(boxes_.size());
    build(first + count / 2, count - count / 2, centres);
}

std::optional<SurfaceTree::Hit> SurfaceTree::closest(const Eigen::Vector3d& point, double reach_mm,
                                                     const NormalGate& gate) const {
    double best = reach_mm * reach_mm;
    Hit hit;
    std::array<std::pair<int, double>, deepest> stack;  // box, squared distance to it
    std::size_t waiting = 0;
    stack[waiting++] = {0, boxes_[0].extent.squaredExteriorDistance(point)};
    while (waiting > 0) {
        const auto [index, squared_to_box] = stack[--waiting];
        if (squared_to_box > best) continue;
        const Box& box = boxes_[static_cast<std::size_t>(index)];
        for (int n = box.first; n < box.first + box.count; ++n) {
            const int t = order_[static_cast<std::size_t>(n)];
            if (!passes(gate, face_normals_.col(t))) continue;
            const Eigen::Matrix3d corners = surface_.nodes(Eigen::all, surface_.triangles.col(t));
            const Eigen::Vector3d a = corners.col(0);
            const Eigen::Vector3d weights = closest_in_triangle(corners.col(1) - a, corners.col(2) - a, point - a);
            const Eigen::Vector3d there = corners * weights;
            const double squared = (there - point).squaredNorm();
            if (squared > best || (squared == best && hit.triangle >= 0 && hit.triangle < t)) continue;
            best = squared;
            hit.triangle = t;
            hit.barycentric = weights;
            hit.point = there;
        }
        if (box.count > 0) continue;
        const int left = index + 1;
        const double to_left = boxes_[static_cast<std::size_t>(left)].extent.squaredExteriorDistance(point);
        const double to_right = boxes_[static_cast<std::size_t>(box.right)].extent.squaredExteriorDistance(point);
        stack[waiting++] = to_left < to_right ? std::pair{box.right, to_right} : std::pair{left, to_left};
        stack[waiting++] = to_left < to_right ? std::pair{left, to_left} : std::pair{box.right, to_right};
    }
    if (hit.triangle < 0) return std::nullopt;
    hit.distance = std::sqrt(best);
    hit.normal = (node_normals_(Eigen::all, surface_.triangles.col(hit.triangle)) * hit.barycentric).normalized();
    return hit;
}

}  // namespace tissuewarp::meshing
