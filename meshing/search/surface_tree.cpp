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

double squared_distance(const Eigen::AlignedBox3d& box, const Eigen::Vector3d& point) {
    return (box.min() - point).cwiseMax(point - box.max()).cwiseMax(0.0).squaredNorm();
}

bool passes(const NormalGate& gate, const Eigen::Vector3d& normal) {
    const double cosine = gate.normal.dot(normal);
    return (gate.oriented ? cosine : std::abs(cosine)) >= gate.least_cosine;
}

}  // namespace

/// What a query has found so far.
struct SurfaceTree::Nearest {
    const Eigen::Vector3d& point;
    const NormalGate& gate;
    double squared;
    Hit hit;

    void look_at(const Facet& facet) {
        if (!passes(gate, facet.normal)) return;
        const Eigen::Vector3d a = facet.corners.col(0);
        const Eigen::Vector3d weights =
            closest_in_triangle(facet.corners.col(1) - a, facet.corners.col(2) - a, point - a);
        const Eigen::Vector3d there = facet.corners * weights;
        const double to_there = (there - point).squaredNorm();
        if (to_there > squared || (to_there == squared && hit.triangle >= 0 && hit.triangle <= facet.triangle)) return;
        squared = to_there;
        hit.triangle = facet.triangle;
        hit.barycentric = weights;
        hit.point = there;
    }
};

SurfaceTree::SurfaceTree(const meshing::SurfaceMesh& surface)
    : surface_(surface), node_normals_(meshing::node_normals(surface)) {
    const int count = surface.triangle_count();
    if (count == 0) throw InvalidInput("a surface without triangles has no closest point");
    std::vector<int> order(static_cast<std::size_t>(count));
    std::iota(order.begin(), order.end(), 0);
    Eigen::Matrix3Xd centres(3, count);
    for (int t = 0; t < count; ++t)
        centres.col(t) = surface.nodes(Eigen::all, surface.triangles.col(t)).rowwise().mean();
    build(0, count, order, centres);
    facet_of_.resize(order.size());
    for (const int t : order) {
        const Eigen::Matrix3d corners = surface.nodes(Eigen::all, surface.triangles.col(t));
        const Eigen::Vector3d ab = corners.col(1) - corners.col(0), ac = corners.col(2) - corners.col(0);
        facet_of_[static_cast<std::size_t>(t)] = static_cast<int>(facets_.size());
        facets_.push_back({corners, ab.cross(ac).normalized(), t});
    }
}

void SurfaceTree::build(int first, int count, std::vector<int>& order, const Eigen::Matrix3Xd& centres) {
    const std::size_t here = boxes_.size();
    boxes_.emplace_back();
    Eigen::AlignedBox3d extent, middles;
    for (int n = first; n < first + count; ++n) {
        const int triangle = order[static_cast<std::size_t>(n)];
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
    const auto at = order.begin() + first;
    std::nth_element(at, at + count / 2, at + count, [&](int a, int b) {
        return centres(axis, a) != centres(axis, b) ? centres(axis, a) < centres(axis, b) : a < b;
    });
    build(first, count / 2, order, centres);
    boxes_[here].right = static_cast<int>(boxes_.size());
    build(first + count / 2, count - count / 2, order, centres);
}

std::optional<SurfaceTree::Hit> SurfaceTree::closest(const Eigen::Vector3d& point, double reach_mm,
                                                     const NormalGate& gate, int guess) const {
    Nearest best{point, gate, reach_mm * reach_mm, {}};
    if (guess >= 0) best.look_at(facets_[static_cast<std::size_t>(facet_of_[static_cast<std::size_t>(guess)])]);
    std::array<std::pair<int, double>, deepest> stack;  // box, squared distance to it
    std::size_t waiting = 0;
    stack[waiting++] = {0, squared_distance(boxes_[0].extent, point)};
    while (waiting > 0) {
        const auto [index, squared_to_box] = stack[--waiting];
        if (squared_to_box > best.squared) continue;
        const Box& box = boxes_[static_cast<std::size_t>(index)];
        for (int n = box.first; n < box.first + box.count; ++n) best.look_at(facets_[static_cast<std::size_t>(n)]);
        if (box.count > 0) continue;
        const int left = index + 1;
        const double to_left = squared_distance(boxes_[static_cast<std::size_t>(left)].extent, point);
        const double to_right = squared_distance(boxes_[static_cast<std::size_t>(box.right)].extent, point);
        stack[waiting++] = to_left < to_right ? std::pair{box.right, to_right} : std::pair{left, to_left};
        stack[waiting++] = to_left < to_right ? std::pair{left, to_left} : std::pair{box.right, to_right};
    }
    Hit& hit = best.hit;
    if (hit.triangle < 0) return std::nullopt;
    hit.distance = std::sqrt(best.squared);
    hit.normal = (node_normals_(Eigen::all, surface_.triangles.col(hit.triangle)) * hit.barycentric).normalized();
    return hit;
}

}  // namespace tissuewarp::meshing
