#include "registration/search/curve_tree.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace tissuewarp::registration::detail {

namespace {

constexpr std::size_t leaf = 8;

}  // namespace

CurveTree::CurveTree(Eigen::Matrix3Xd points, std::vector<Segment> segments)
    : points_(std::move(points)), segments_(std::move(segments)), order_(segments_.size()) {
    const auto count = static_cast<Eigen::Index>(segments_.size());
    middles_.resize(3, count);
    tangents_.resize(3, count);
    for (Eigen::Index s = 0; s < count; ++s) {
        const Segment& segment = segments_[static_cast<std::size_t>(s)];
        const Eigen::Vector3d a = points_.col(segment.ends[0]), b = points_.col(segment.ends[1]);
        middles_.col(s) = 0.5 * (a + b);
        tangents_.col(s) = (points_.col(segment.chord[1]) - points_.col(segment.chord[0])).stableNormalized();
        longest_half_ = std::max(longest_half_, 0.5 * (b - a).norm());
    }
    std::iota(order_.begin(), order_.end(), 0);
    build(0, order_.size(), 0);
}

void CurveTree::build(std::size_t first, std::size_t last, int axis) {
    if (last - first <= leaf) return;
    const std::size_t middle = first + (last - first) / 2;
    const auto at = [&](std::size_t n) { return order_.begin() + static_cast<std::ptrdiff_t>(n); };
    std::nth_element(at(first), at(middle), at(last),
                     [&](int a, int b) { return middles_(axis, a) < middles_(axis, b); });
    build(first, middle, (axis + 1) % 3);
    build(middle + 1, last, (axis + 1) % 3);
}

std::optional<CurveTree::Hit> CurveTree::nearest(const Eigen::Vector3d& query, double reach,
                                                 const TangentGate& gate) const {
    Hit best;
    best.distance = reach;
    search(query, gate, 0, order_.size(), 0, best);
    if (best.segment < 0) return std::nullopt;
    return best;
}

void CurveTree::search(const Eigen::Vector3d& query, const TangentGate& gate, std::size_t first, std::size_t last,
                       int axis, Hit& best) const {
    if (last - first <= leaf) {
        for (std::size_t n = first; n < last; ++n) visit(order_[n], query, gate, best);
        return;
    }
    const std::size_t middle = first + (last - first) / 2;
    visit(order_[middle], query, gate, best);
    const double offset = query[axis] - middles_(axis, order_[middle]);
    const int next = (axis + 1) % 3;
    const bool below = offset < 0;
    search(query, gate, below ? first : middle + 1, below ? middle : last, next, best);
    if (std::abs(offset) - longest_half_ > best.distance) return;
    search(query, gate, below ? middle + 1 : first, below ? last : middle, next, best);
}

void CurveTree::visit(int segment, const Eigen::Vector3d& query, const TangentGate& gate, Hit& best) const {
    if ((middles_.col(segment) - query).norm() - longest_half_ > best.distance) return;
    const Eigen::Vector3d tangent = tangents_.col(segment);
    if (!gate.tangent.isZero() && std::abs(gate.tangent.dot(tangent)) < gate.least_cosine) return;
    const auto& [from, to] = segments_[static_cast<std::size_t>(segment)].ends;
    const Eigen::Vector3d start = points_.col(from), way = points_.col(to) - start;
    const double squared = way.squaredNorm();
    const double along = squared > 0 ? std::clamp(way.dot(query - start) / squared, 0.0, 1.0) : 0.0;
    const Eigen::Vector3d place = start + along * way;
    const double distance = (query - place).norm();
    const bool nearer = distance < best.distance || (distance == best.distance && segment < best.segment);
    if (nearer) best = {segment, along, place, tangent, distance};
}

}  // namespace tissuewarp::registration::detail
