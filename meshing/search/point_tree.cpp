#include "meshing/search/point_tree.hpp"

#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <cmath>

namespace tissuewarp::meshing {

PointTree::PointTree(const std::vector<Eigen::Vector3d>& points) {
    entries_.reserve(points.size());
    for (const Eigen::Vector3d& point : points) entries_.push_back({point, static_cast<int>(entries_.size())});
    build({0, entries_.size(), 0});
}

PointTree::PointTree(const Eigen::Matrix3Xd& points)
    : PointTree(std::vector<Eigen::Vector3d>(points.colwise().begin(), points.colwise().end())) {}

PointTree::PointTree(const Eigen::Matrix3Xd& points, const std::vector<int>& columns) {
    entries_.reserve(columns.size());
    for (const int column : columns) entries_.push_back({points.col(column), column});
    build({0, entries_.size(), 0});
}

void PointTree::build(const Range& range) {
    constexpr std::size_t worth_a_thread = 500;
    if (range.is_leaf()) return;
    const auto at = [&](std::size_t n) { return entries_.begin() + static_cast<std::ptrdiff_t>(n); };
    std::nth_element(at(range.first), at(range.middle()), at(range.last),
                     [&](const Entry& a, const Entry& b) { return a.point[range.axis] < b.point[range.axis]; });
    const auto below = [&] { build(range.below()); };
    const auto above = [&] { build(range.above()); };
    if (range.last - range.first > worth_a_thread) {
        tbb::parallel_invoke(below, above);
        return;
    }
    below();
    above();
}

PointTree::Neighbour PointTree::nearest(const Eigen::Vector3d& query) const {
    Neighbour best;
    descend(
        query, [&] { return best.squared_distance; },
        [&](const Entry& entry) {
            best = std::min(best, {(entry.point - query).squaredNorm(), entry.index});
        },
        {0, entries_.size(), 0}, Eigen::Vector3d::Zero());
    return best;
}

std::vector<PointTree::Neighbour> PointTree::nearest(const Eigen::Vector3d& query, std::size_t count, int but) const {
    std::vector<Neighbour> found;
    if (count == 0) return found;
    found.reserve(std::min(count, entries_.size()));
    const auto offer = [&](const Entry& entry) {
        if (entry.index == but) return;
        const Neighbour candidate{(entry.point - query).squaredNorm(), entry.index};
        if (found.size() == count) {
            if (!(candidate < found.back())) return;
            found.pop_back();
        }
        found.insert(std::upper_bound(found.begin(), found.end(), candidate), candidate);
    };
    const auto squared_reach = [&] {
        return found.size() == count ? found.back().squared_distance : Neighbour{}.squared_distance;
    };
    descend(query, squared_reach, offer, {0, entries_.size(), 0}, Eigen::Vector3d::Zero());
    return found;
}

double PointTree::distance(const Eigen::Vector3d& query) const {
    return std::sqrt(nearest(query).squared_distance);
}

bool PointTree::any_within(const Eigen::Vector3d& query, double radius) const {
    double reach = radius * radius;
    bool any = false;
    descend(
        query, [&] { return reach; },
        [&](const Entry& entry) {
            if (!((entry.point - query).squaredNorm() < radius * radius)) return;
            any = true;
            reach = -1.0;  // enough
        },
        {0, entries_.size(), 0}, Eigen::Vector3d::Zero());
    return any;
}

int PointTree::count_within(const Eigen::Vector3d& query, double radius) const {
    int count = 0;
    // A little farther than the radius, whose square rounds.
    descend(
        query, [&] { return (1 + 1e-12) * radius * radius; },
        [&](const Entry& entry) { count += (entry.point - query).norm() <= radius; }, {0, entries_.size(), 0},
        Eigen::Vector3d::Zero());
    return count;
}

}  // namespace tissuewarp::meshing
