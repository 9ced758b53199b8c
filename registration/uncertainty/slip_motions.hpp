#pragma once
/// How far parts that slide on one another may have slid beyond what was found: boundaries feel little of it.

#include "registration/prepare.hpp"

#include <Eigen/Core>

namespace tissuewarp::registration::detail {

struct SlipModel {
    /// Deviation of every slip over how far the surfaces slid: that of turns over the turn found (DatumKind::of_turn).
    double of_slip = 0.3;
    /// A motion of a part leads its surface along itself where less than this share of it, squared, goes across. By
    /// hand: 0.002 to 0.004 of the turns of a ball in its socket and 0.6 and more of all else, on
    /// `scripts/sliding_pairs` 1, 2 and 4.
    double most_across = 0.05;
};
inline constexpr SlipModel slip_model{};

/// Root mean square of how far surfaces slid, mm, each pair weighed by its stiffness; 0 without pairs.
double slid_mm(const std::vector<tled::SlidingPair>& pairs, const Eigen::Matrix3Xd& displacement);

/// Motions as a whole of the first part of every pair of labels that slide, along the surface between them: the turns
/// of a ball in its socket, shifts and a turn of a plane. 3N × k, mm, each one deviation; 3N × 0 where nothing slides.
/// `displacement` (3 × N, mm) is what was found.
Eigen::MatrixXd slip_motions(const PreparedModel& prepared, const Eigen::Matrix3Xd& displacement);

}  // namespace tissuewarp::registration::detail
