#pragma once
/// Nearest neighbours among points: a balanced k-d tree (Bentley 1975) stored as a permutation of the points.

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <vector>

namespace tissuewarp::registration::detail {

class PointTree {
public:
    explicit PointTree(const std::vector<Eigen::Vector3d>& points) {
        entries_.reserve(points.size());
        for (const Eigen::Vector3d& point : points) entries_.push_back({point, entries_.size()});
        build(0, entries_.size(), 0);
    }

    struct Nearest {
        double squared_distance = std::numeric_limits<double>::infinity();
        std::size_t index = 0;  ///< among the points given; the first of several as near

        bool operator<(const Nearest& other) const {
            return std::tie(squared_distance, index) < std::tie(other.squared_distance, other.index);
        }
    };

    /// Thread-safe; infinitely far when there is none.
    [[nodiscard]] Nearest nearest(const Eigen::Vector3d& query) const {
        Nearest best;
        search(query, 0, entries_.size(), 0, best);
        return best;
    }

    /// Distance to the nearest point; infinity when there is none. Thread-safe.
    [[nodiscard]] double distance(const Eigen::Vector3d& query) const {
        return std::sqrt(nearest(query).squared_distance);
    }

private:
    struct Entry {
        Eigen::Vector3d point;
        std::size_t index;
    };
    static constexpr std::size_t leaf = 8;

    void build(std::size_t first, std::size_t last, int axis) {
        if (last - first <= leaf) return;
        const std::size_t middle = first + (last - first) / 2;
        const auto at = [&](std::size_t n) { return entries_.begin() + static_cast<std::ptrdiff_t>(n); };
        std::nth_element(at(first), at(middle), at(last),
                         [axis](const Entry& a, const Entry& b) { return a.point[axis] < b.point[axis]; });
        build(first, middle, (axis + 1) % 3);
        build(middle + 1, last, (axis + 1) % 3);
    }

    void look(const Eigen::Vector3d& query, std::size_t at, Nearest& best) const {
        best = std::min(best, {(entries_[at].point - query).squaredNorm(), entries_[at].index});
    }

    void search(const Eigen::Vector3d& query, std::size_t first, std::size_t last, int axis, Nearest& best) const {
        if (last - first <= leaf) {
            for (std::size_t n = first; n < last; ++n) look(query, n, best);
            return;
        }
        const std::size_t middle = first + (last - first) / 2;
        look(query, middle, best);
        const double offset = query[axis] - entries_[middle].point[axis];
        const int next = (axis + 1) % 3;
        const auto below = [&] { search(query, first, middle, next, best); };
        const auto above = [&] { search(query, middle + 1, last, next, best); };
        offset < 0.0 ? below() : above();
        if (offset * offset <= best.squared_distance) offset < 0.0 ? above() : below();
    }

    std::vector<Entry> entries_;
};

}  // namespace tissuewarp::registration::detail
