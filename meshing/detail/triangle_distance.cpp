#include "meshing/detail/triangle_distance.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <limits>

namespace tissuewarp::meshing::detail {

double distance(const Eigen::Vector3d& point, const Triangle& triangle) {
    const auto& [a, b, c] = triangle;
    const Eigen::Vector3d ab = b - a, ac = c - a, ap = point - a;
    const double d1 = ab.dot(ap), d2 = ac.dot(ap);
    if (d1 <= 0.0 && d2 <= 0.0) return ap.norm();
    const Eigen::Vector3d bp = point - b;
    const double d3 = ab.dot(bp), d4 = ac.dot(bp);
    if (d3 >= 0.0 && d4 <= d3) return bp.norm();
    const double vc = d1 * d4 - d3 * d2;
    if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) return (ap - d1 / (d1 - d3) * ab).norm();
    const Eigen::Vector3d cp = point - c;
    const double d5 = ab.dot(cp), d6 = ac.dot(cp);
    if (d6 >= 0.0 && d5 <= d6) return cp.norm();
    const double vb = d5 * d2 - d1 * d6;
    if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) return (ap - d2 / (d2 - d6) * ac).norm();
    const double va = d3 * d6 - d5 * d4;
    if (va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0)
        return (bp - (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b)).norm();
    return std::abs(ap.dot(ab.cross(ac).normalized()));
}

TriangleDistance::TriangleDistance(std::vector<Triangle> triangles, double cell)
    : triangles_(std::move(triangles)), cell_(cell), lower_(Eigen::Vector3d::Zero()) {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    Eigen::Vector3d upper = Eigen::Vector3d::Constant(-infinity);
    if (!triangles_.empty()) lower_.setConstant(infinity);
    for (const Triangle& triangle : triangles_)
        for (const Eigen::Vector3d& corner : triangle) {
            lower_ = lower_.cwiseMin(corner);
            upper = upper.cwiseMax(corner);
        }
    if (!triangles_.empty()) {
        cell_ = std::max(cell_, (upper - lower_).maxCoeff() / 255.0);  // bounds the memory of the grid
        for (int axis = 0; axis < 3; ++axis) cells_[axis] = static_cast<int>((upper[axis] - lower_[axis]) / cell_) + 1;
    }
    const auto each_cell = [&](const Triangle& triangle, const auto& visit) {
        const Eigen::Vector3d low = triangle[0].cwiseMin(triangle[1]).cwiseMin(triangle[2]);
        const Eigen::Vector3d high = triangle[0].cwiseMax(triangle[1]).cwiseMax(triangle[2]);
        const Eigen::Array3i from = cell_of(low), to = cell_of(high);
        for (int k = from[2]; k <= to[2]; ++k)
            for (int j = from[1]; j <= to[1]; ++j)
                for (int i = from[0]; i <= to[0]; ++i)
                    visit(static_cast<std::size_t>(i + cells_[0] * (j + cells_[1] * k)));
    };
    offset_.assign(static_cast<std::size_t>(cells_[0] * cells_[1] * cells_[2]) + 1, 0);
    for (const Triangle& triangle : triangles_) each_cell(triangle, [&](std::size_t c) { ++offset_[c + 1]; });
    for (std::size_t c = 1; c < offset_.size(); ++c) offset_[c] += offset_[c - 1];
    entry_.resize(static_cast<std::size_t>(offset_.back()));
    std::vector<int> next(offset_.begin(), offset_.end() - 1);
    for (std::size_t t = 0; t < triangles_.size(); ++t)
        each_cell(triangles_[t],
                  [&](std::size_t c) { entry_[static_cast<std::size_t>(next[c]++)] = static_cast<int>(t); });
}

Eigen::Array3i TriangleDistance::cell_of(const Eigen::Vector3d& point) const {
    Eigen::Array3i cell;
    for (int axis = 0; axis < 3; ++axis)
        cell[axis] = static_cast<int>(
            std::clamp(std::floor((point[axis] - lower_[axis]) / cell_), 0.0, static_cast<double>(cells_[axis] - 1)));
    return cell;
}

double TriangleDistance::operator()(const Eigen::Vector3d& point) const {
    double best = std::numeric_limits<double>::infinity();
    if (triangles_.empty()) return best;
    const Eigen::Array3i centre = cell_of(point);
    const int rings = std::max({cells_[0], cells_[1], cells_[2]});
    for (int ring = 0; ring <= rings; ++ring) {
        // Triangles not met yet lie outside the rings searched, which hold a ball of (ring − 1) cells around the
        // point's foot on the box; the point itself is no nearer to them than that foot.
        if (best <= (ring - 1) * cell_) break;
        for (int k = std::max(0, centre[2] - ring); k <= std::min(cells_[2] - 1, centre[2] + ring); ++k)
            for (int j = std::max(0, centre[1] - ring); j <= std::min(cells_[1] - 1, centre[1] + ring); ++j) {
                const bool shell = std::abs(k - centre[2]) == ring || std::abs(j - centre[1]) == ring;
                for (int i = centre[0] - ring; i <= centre[0] + ring; i += shell || ring == 0 ? 1 : 2 * ring) {
                    if (i < 0 || i >= cells_[0]) continue;
                    const auto c = static_cast<std::size_t>(i + cells_[0] * (j + cells_[1] * k));
                    for (int e = offset_[c]; e < offset_[c + 1]; ++e)
                        best = std::min(
                            best,
                            distance(point, triangles_[static_cast<std::size_t>(entry_[static_cast<std::size_t>(e)])]));
                }
            }
    }
    return best;
}

}  // namespace tissuewarp::meshing::detail
