#pragma once
/// The nearest of many points.

#include <Eigen/Core>

#include <compare>
#include <cstddef>
#include <limits>
#include <vector>

namespace tissuewarp::meshing {

/// A balanced k-d tree (Bentley 1975). Holds copies of its points; queries are thread-safe and take points in mm.
class PointTree {
public:
    /// In order of distance, and of the index among points as near.
    struct Neighbour {
        double squared_distance = std::numeric_limits<double>::infinity();  ///< mm²
        int index = 0;                                                      ///< among the points given

        auto operator<=>(const Neighbour&) const = default;
    };

    explicit PointTree(const std::vector<Eigen::Vector3d>& points);
    explicit PointTree(const Eigen::Matrix3Xd& points);
    /// Of some columns of 3 × P points, whose numbers are the indices.
    PointTree(const Eigen::Matrix3Xd& points, const std::vector<int>& columns);

    /// Infinitely far when there is none.
    [[nodiscard]] Neighbour nearest(const Eigen::Vector3d& query) const;

    /// Ascending, fewer than `count` where there are fewer; `but` is the index of one that is passed over.
    [[nodiscard]] std::vector<Neighbour> nearest(const Eigen::Vector3d& query, std::size_t count, int but = -1) const;

    /// Distance to the nearest point, mm; infinity when there is none.
    [[nodiscard]] double distance(const Eigen::Vector3d& query) const;

    /// Whether any point is nearer than a radius.
    [[nodiscard]] bool any_within(const Eigen::Vector3d& query, double radius) const;

    /// How many points are no farther than a radius.
    [[nodiscard]] int count_within(const Eigen::Vector3d& query, double radius) const;

    /// Calls visit(index) for points by and by, those on the side of the query first, and leaves out those that are
    /// certainly farther than what squared_reach() (mm²) is by then.
    template <class SquaredReach, class Visit>
    void visit_near(const Eigen::Vector3d& query, const SquaredReach& squared_reach, const Visit& visit) const {
        descend(
            query, squared_reach, [&](const Entry& entry) { visit(entry.index); }, {0, entries_.size(), 0},
            Eigen::Vector3d::Zero());
    }

private:
    struct Entry {
        Eigen::Vector3d point;
        int index;
    };
    /// Of the entries; the middle one divides the others along the axis.
    struct Range {
        std::size_t first, last;
        int axis;

        [[nodiscard]] bool is_leaf() const { return last - first <= 8; }
        [[nodiscard]] std::size_t middle() const { return first + (last - first) / 2; }
        [[nodiscard]] Range below() const { return {first, middle(), (axis + 1) % 3}; }
        [[nodiscard]] Range above() const { return {middle() + 1, last, (axis + 1) % 3}; }
    };
    std::vector<Entry> entries_;

    void build(const Range& range);

    /// `away` leads from the query to the box of the range, along each axis.
    template <class SquaredReach, class Visit>
    void descend(const Eigen::Vector3d& query, const SquaredReach& squared_reach, const Visit& visit,
                 const Range& range, const Eigen::Vector3d& away) const {
        if (range.is_leaf()) {
            for (std::size_t n = range.first; n < range.last; ++n) visit(entries_[n]);
            return;
        }
        const Entry& middle = entries_[range.middle()];
        visit(middle);
        const double offset = query[range.axis] - middle.point[range.axis];
        const bool is_below = offset < 0.0;
        descend(query, squared_reach, visit, is_below ? range.below() : range.above(), away);
        Eigen::Vector3d across = away;
        across[range.axis] = offset;
        if (across.squaredNorm() > squared_reach()) return;
        descend(query, squared_reach, visit, is_below ? range.above() : range.below(), across);
    }
};

}  // namespace tissuewarp::meshing
