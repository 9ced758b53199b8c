#pragma once
/// Nearest neighbours among points: a balanced k-d tree (Bentley 1975) stored as a permutation of the points.

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace tissuewarp::registration::detail {

class PointTree {
public:
    explicit PointTree(std::vector<Eigen::Vector3d> points) : points_(std::move(points)) {
        build(0, points_.size(), 0);
    }

    /// Distance to the nearest point; infinity when there is none. Thread-safe.
    [[nodiscard]] double distance(const Eigen::Vector3d& query) const {
        double best = std::numeric_limits<double>::infinity();
        search(query, 0, points_.size(), 0, best);
        return std::sqrt(best);
    }

private:
    static constexpr std::size_t leaf = 8;

    void build(std::size_t first, std::size_t last, int axis) {
        if (last - first <= leaf) return;
        const std::size_t middle = first + (last - first) / 2;
        const auto at = [&](std::size_t n) { return points_.begin() + static_cast<std::ptrdiff_t>(n); };
        std::nth_element(at(first), at(middle), at(last),
                         [axis](const auto& a, const auto& b) { return a[axis] < b[axis]; });
        build(first, middle, (axis + 1) % 3);
        build(middle + 1, last, (axis + 1) % 3);
    }

    void search(const Eigen::Vector3d& query, std::size_t first, std::size_t last, int axis, double& best) const {
        if (last - first <= leaf) {
            for (std::size_t n = first; n < last; ++n) best = std::min(best, (points_[n] - query).squaredNorm());
            return;
        }
        const std::size_t middle = first + (last - first) / 2;
        best = std::min(best, (points_[middle] - query).squaredNorm());
        const double offset = query[axis] - points_[middle][axis];
        const int next = (axis + 1) % 3;
        if (offset < 0.0) {
            search(query, first, middle, next, best);
            if (offset * offset < best) search(query, middle + 1, last, next, best);
        } else {
            search(query, middle + 1, last, next, best);
            if (offset * offset < best) search(query, first, middle, next, best);
        }
    }

    std::vector<Eigen::Vector3d> points_;
};

}  // namespace tissuewarp::registration::detail
