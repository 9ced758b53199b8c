#include "registration/matching/consistency/local_affine.hpp"

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <numeric>

namespace tissuewarp::registration::detail {

namespace {

/// A balanced k-d tree (Bentley 1975) over some columns, kept as a permutation of them.
class ColumnTree {
public:
    ColumnTree(const Eigen::Matrix3Xd& points, const std::vector<int>& columns) : points_(points), order_(columns) {
        build(0, order_.size(), 0);
        ordered_ = points(Eigen::all, order_);
    }

    /// The nearest others of a column, by distance and then by index.
    [[nodiscard]] std::vector<int> nearest(int column, std::size_t count) const {
        Search search{points_.col(column), column, count, {}};
        search.found.reserve(count);
        if (count > 0) gather(search, 0, order_.size(), 0, Eigen::Vector3d::Zero());
        std::vector<int> result;
        result.reserve(search.found.size());
        for (const auto& [distance, other] : search.found) result.push_back(other);
        return result;
    }

private:
    static constexpr std::size_t leaf = 8, worth_a_thread = 500;
    const Eigen::Matrix3Xd& points_;
    std::vector<int> order_;
    Eigen::Matrix3Xd ordered_;  // those columns, side by side as they are met

    struct Search {
        Eigen::Vector3d query;
        int self;
        std::size_t count;
        std::vector<std::pair<double, int>> found;  // squared distances, ascending: few are let in
    };

    void build(std::size_t first, std::size_t last, int axis) {
        if (last - first <= leaf) return;
        const std::size_t middle = first + (last - first) / 2;
        const auto at = [&](std::size_t n) { return order_.begin() + static_cast<std::ptrdiff_t>(n); };
        std::nth_element(at(first), at(middle), at(last),
                         [&](int a, int b) { return points_(axis, a) < points_(axis, b); });
        const int next = (axis + 1) % 3;
        const auto below = [&] { build(first, middle, next); };
        const auto above = [&] { build(middle + 1, last, next); };
        if (last - first > worth_a_thread) {
            tbb::parallel_invoke(below, above);
            return;
        }
        below();
        above();
    }

    void offer(Search& search, std::size_t n) const {
        const int other = order_[n];
        if (other == search.self) return;
        const std::pair<double, int> candidate{
            (ordered_.col(static_cast<Eigen::Index>(n)) - search.query).squaredNorm(), other};
        if (search.found.size() == search.count) {
            if (!(candidate < search.found.back())) return;
            search.found.pop_back();
        }
        search.found.insert(std::upper_bound(search.found.begin(), search.found.end(), candidate), candidate);
    }

    /// `away` leads from the query to the box of these columns, along each axis.
    void gather(Search& search, std::size_t first, std::size_t last, int axis, const Eigen::Vector3d& away) const {
        if (last - first <= leaf) {
            for (std::size_t n = first; n < last; ++n) offer(search, n);
            return;
        }
        const std::size_t middle = first + (last - first) / 2;
        offer(search, middle);
        const double offset = search.query[axis] - ordered_(axis, static_cast<Eigen::Index>(middle));
        const int next = (axis + 1) % 3;
        const auto below = [&](const Eigen::Vector3d& to) { gather(search, first, middle, next, to); };
        const auto above = [&](const Eigen::Vector3d& to) { gather(search, middle + 1, last, next, to); };
        if (offset < 0.0)
            below(away);
        else
            above(away);
        Eigen::Vector3d across = away;
        across[axis] = offset;
        const bool full = search.found.size() == search.count;
        if (full && across.squaredNorm() > search.found.back().first) return;
        if (offset < 0.0)
            above(across);
        else
            below(across);
    }
};

}  // namespace

std::vector<std::vector<int>> nearest_neighbours(const Eigen::Matrix3Xd& points, const std::vector<int>& of,
                                                 const std::vector<int>& among, int count) {
    const ColumnTree tree(points, among);
    std::vector<std::vector<int>> result(of.size());
    tbb::parallel_for(std::size_t{0}, result.size(), [&](std::size_t n) {
        result[n] = tree.nearest(of[n], static_cast<std::size_t>(std::max(count, 0)));
    });
    return result;
}

std::vector<std::vector<int>> nearest_neighbours(const Eigen::Matrix3Xd& points, int count) {
    std::vector<int> all(static_cast<std::size_t>(points.cols()));
    std::iota(all.begin(), all.end(), 0);
    return nearest_neighbours(points, all, all, count);
}

}  // namespace tissuewarp::registration::detail
