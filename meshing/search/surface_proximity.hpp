#pragma once
/// The closest point of a triangle surface and a nodal field there, for points near the surface.

#include "meshing/search/surface_tree.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

namespace tissuewarp::meshing {

/// Cells list the triangles that any of their points could have within reach.
class SurfaceProximity {
public:
    struct Hit {
        double distance;               ///< mm
        Eigen::Vector3d point, value;  ///< closest point and the field there
    };

    /// `nodes` and `values` are 3 × N over the nodes of the mesh that `boundary.node_of` refers to.
    SurfaceProximity(const Eigen::Matrix3Xd& nodes, const meshing::BoundarySurface& boundary,
                     const Eigen::Matrix3Xd& values, double reach_mm)
        : reach_(reach_mm) {
        for (const auto& triangle : boundary.surface.triangles.colwise()) {
            Triangle t;
            for (int c = 0; c < 3; ++c) {
                const int node = boundary.node_of[static_cast<std::size_t>(triangle[c])];
                t.corner.col(c) = nodes.col(node);
                t.value.col(c) = values.col(node);
            }
            t.centre = t.corner.rowwise().mean();
            t.radius = (t.corner.colwise() - t.centre).colwise().norm().maxCoeff();
            triangles_.push_back(t);
        }
        fill_cells();
    }

    [[nodiscard]] double reach() const { return reach_; }

    /// The closest point, when it lies within reach. Thread-safe.
    [[nodiscard]] std::optional<Hit> closest(const Eigen::Vector3d& point) const {
        return closest_of(point, [](const Eigen::Vector3d&) { return true; });
    }

    /// The closest point on the other side of `point` than `near`, across a gap of the surface; when within reach.
    [[nodiscard]] std::optional<Hit> closest_opposite(const Eigen::Vector3d& point, const Hit& near) const {
        const Eigen::Vector3d to_near = near.point - point;
        return closest_of(point, [&](const Eigen::Vector3d& to_other) { return to_near.dot(to_other) < 0.0; });
    }

private:
    struct Triangle {
        Eigen::Matrix3d corner, value;  // columns
        Eigen::Vector3d centre;
        double radius;

        [[nodiscard]] Eigen::Vector3d closest(const Eigen::Vector3d& p) const {
            return closest_in_triangle(corner.col(1) - corner.col(0), corner.col(2) - corner.col(0), p - corner.col(0));
        }
    };

    [[nodiscard]] std::size_t cell_at(const Eigen::Array3i& cell) const {
        return static_cast<std::size_t>(cell[0]) +
               static_cast<std::size_t>(cells_[0]) *
                   (static_cast<std::size_t>(cell[1]) +
                    static_cast<std::size_t>(cells_[1]) * static_cast<std::size_t>(cell[2]));
    }

    /// Among the triangles whose closest point, seen from `point`, is admitted.
    template <class Admits>
    [[nodiscard]] std::optional<Hit> closest_of(const Eigen::Vector3d& point, const Admits& admits) const {
        const Eigen::Array3d position = (point - lower_).array() / side_;
        const Eigen::Array3d end(cells_[0], cells_[1], cells_[2]);
        if (!((position >= 0.0).all() && (position < end).all())) return std::nullopt;
        const std::size_t cell = cell_at(position.cast<int>());
        double best = reach_ * reach_;
        const Triangle* nearest = nullptr;
        Eigen::Vector3d weights;
        for (int e = offset_[cell]; e < offset_[cell + 1]; ++e) {
            const Triangle& t = triangles_[static_cast<std::size_t>(entry_[static_cast<std::size_t>(e)])];
            const double bound = std::sqrt(best) + t.radius;
            if ((point - t.centre).squaredNorm() > bound * bound) continue;
            const Eigen::Vector3d lambda = t.closest(point), to_closest = t.corner * lambda - point;
            if (!(to_closest.squaredNorm() < best) || !admits(to_closest)) continue;
            best = to_closest.squaredNorm();
            nearest = &t;
            weights = lambda;
        }
        if (!nearest) return std::nullopt;
        return Hit{std::sqrt(best), nearest->corner * weights, nearest->value * weights};
    }

    void fill_cells() {
        Eigen::Array3d low = Eigen::Array3d::Constant(std::numeric_limits<double>::infinity()), high = -low;
        for (const Triangle& t : triangles_) {
            low = low.min(t.corner.rowwise().minCoeff().array());
            high = high.max(t.corner.rowwise().maxCoeff().array());
        }
        lower_ = low - reach_;
        const Eigen::Array3d extent = high - low + 2.0 * reach_;
        side_ = std::max(0.75 * reach_, std::cbrt(extent.prod() / 4e6));
        for (int axis = 0; axis < 3; ++axis) cells_[axis] = static_cast<int>(extent[axis] / side_) + 1;

        std::vector<std::pair<std::size_t, int>> pairs;  // cell, triangle; in ascending order of triangles
        const double half_diagonal = 0.5 * std::sqrt(3.0) * side_;
        for (std::size_t f = 0; f < triangles_.size(); ++f) {
            const Triangle& t = triangles_[f];
            const Eigen::Array3d from = (t.corner.rowwise().minCoeff() - lower_).array() - reach_;
            const Eigen::Array3d to = (t.corner.rowwise().maxCoeff() - lower_).array() + reach_;
            const Eigen::Array3i first = (from / side_).max(0.0).cast<int>();
            const Eigen::Array3i last =
                (to / side_).cast<int>().min(Eigen::Array3i(cells_[0], cells_[1], cells_[2]) - 1);
            for (int k = first[2]; k <= last[2]; ++k)
                for (int j = first[1]; j <= last[1]; ++j)
                    for (int i = first[0]; i <= last[0]; ++i) {
                        const Eigen::Vector3d centre =
                            lower_ + side_ * (Eigen::Vector3d(i, j, k) + Eigen::Vector3d::Constant(0.5));
                        if ((centre - t.centre).norm() > reach_ + half_diagonal + t.radius) continue;
                        if ((t.corner * t.closest(centre) - centre).norm() > reach_ + half_diagonal) continue;
                        pairs.emplace_back(cell_at({i, j, k}), static_cast<int>(f));
                    }
        }
        const std::size_t count = static_cast<std::size_t>(cells_[0]) * static_cast<std::size_t>(cells_[1]) *
                                  static_cast<std::size_t>(cells_[2]);
        offset_.assign(count + 1, 0);
        for (const auto& [cell, triangle] : pairs) ++offset_[cell + 1];
        for (std::size_t c = 0; c < count; ++c) offset_[c + 1] += offset_[c];
        entry_.resize(pairs.size());
        std::vector<int> next(offset_.begin(), offset_.end() - 1);
        for (const auto& [cell, triangle] : pairs) entry_[static_cast<std::size_t>(next[cell]++)] = triangle;
    }

    std::vector<Triangle> triangles_;
    double reach_, side_ = 1.0;
    Eigen::Vector3d lower_ = Eigen::Vector3d::Zero();
    std::array<int, 3> cells_{};
    std::vector<int> offset_, entry_;
};

}  // namespace tissuewarp::meshing
