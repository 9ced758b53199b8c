#pragma once
/// How far parts that slide on one another may have slid beyond what was found: boundaries feel little of it.

#include "registration/prepare.hpp"

#include <Eigen/Core>

namespace tissuewarp::registration::detail {

struct SlipModel {
    double of_slip = 0.3;  ///< deviation of every slip, of how far the surfaces slid. Chosen with …
    double most_across =
        0.05;  ///< … a motion of a part slides where surfaces move across themselves by less than this share, squared
};
inline constexpr SlipModel slip_model{};

/// Motions as a whole of the first part of every pair of labels that slide, along the surface between them: the turns
/// of a ball in its socket, shifts and a turn of a plane. 3N × k, mm, each one deviation; 3N × 0 where nothing slides.
/// `displacement` (3 × N, mm) is what was found.
Eigen::MatrixXd slip_motions(const PreparedModel& prepared, const Eigen::Matrix3Xd& displacement);

}  // namespace tissuewarp::registration::detail
