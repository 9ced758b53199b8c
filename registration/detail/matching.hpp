#pragma once
/// One round of correspondence: interface nodes of the deformed mesh to the boundaries of the fixed labels.

#include "registration/detail/evidence.hpp"
#include "registration/detail/surface_springs.hpp"

namespace tissuewarp::registration::detail {

/// Matches every interface node of the deformed mesh to the fixed boundary along its normal, where that boundary's own
/// normal lies within `max_angle_deg` of it. `normals`: one column per interface node, moving frame.
std::vector<Match> match_interfaces(const PreparedModel& prepared, const LabelBoundaryField& fixed, const State& state,
                                    const Eigen::Matrix3Xd& normals, const RoundPlan& plan, double max_angle_deg);

/// Drops the share of matches that the model follows least, where they are further off than `scale_mm` (Clatz 2005).
void trim(std::vector<Match>& matches, double share, double scale_mm);

/// Weighted mean of |distance|, mm.
double mean_residual(const std::vector<Match>& matches);

}  // namespace tissuewarp::registration::detail
