#include "meshing/search/curve_tree.hpp"

#include <algorithm>
#include <cmath>

namespace tissuewarp::meshing {

namespace {

Eigen::Matrix3Xd middles_of(const Eigen::Matrix3Xd& points, const std::vector<Segment>& segments) {
    Eigen::Matrix3Xd middles(3, static_cast<Eigen::Index>(segments.size()));
    for (std::size_t s = 0; s < segments.size(); ++s) {
        const auto& [from, to] = segments[s].ends;
        middles.col(static_cast<Eigen::Index>(s)) = 0.5 * (points.col(from) + points.col(to));
    }
    return middles;
}

}  // namespace

CurveTree::CurveTree(Eigen::Matrix3Xd points, std::vector<Segment> segments)
    : points_(std::move(points)),
      segments_(std::move(segments)),
      middles_(middles_of(points_, segments_)),
      tangents_(3, middles_.cols()),
      tree_(middles_) {
    for (std::size_t s = 0; s < segments_.size(); ++s) {
        const auto& [ends, chord] = segments_[s];
        tangents_.col(static_cast<Eigen::Index>(s)) =
            (points_.col(chord[1]) - points_.col(chord[0])).stableNormalized();
        longest_half_ = std::max(longest_half_, 0.5 * (points_.col(ends[1]) - points_.col(ends[0])).norm());
    }
}

std::optional<CurveTree::Hit> CurveTree::nearest(const Eigen::Vector3d& query, double reach,
                                                 const TangentGate& gate) const {
    Hit best;
    best.distance = reach;
    const auto squared_reach = [&] {
        const double to_middle = (1 + 1e-12) * (best.distance + longest_half_);  // its square rounds
        return to_middle * to_middle;
    };
    tree_.visit_near(query, squared_reach, [&](int segment) { visit(segment, query, gate, best); });
    if (best.segment < 0) return std::nullopt;
    return best;
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

}  // namespace tissuewarp::meshing
