#pragma once
/// One round of correspondence: interface nodes of the deformed mesh to the boundaries of the fixed labels.

#include "registration/detail/surface_springs.hpp"

namespace tissuewarp::registration::detail {

/// What a round looks for, and how far it may pull.
struct Search {
    double range_mm = 0;
    double max_angle_deg = 0;
    double scale_mm = 0;  ///< of the Geman–McClure weight (σ²/(σ² + d²))², which lowers what the model did not follow
    double most_step_mm = 0;  ///< bound on the distance asked for, so that elements are not turned over
};

/// Matches every interface node of the deformed mesh to the fixed boundary along its normal. `displacement` is 3 × N in
/// the moving frame, `normals` one column per interface node.
std::vector<Match> match_interfaces(const PreparedModel& prepared, const LabelBoundaryField& fixed,
                                    const Eigen::Isometry3d& placement, const Eigen::Matrix3Xd& displacement,
                                    const Eigen::Matrix3Xd& normals, const Search& search);

/// Drops the share of matches that the model follows least, where they are further off than `scale_mm` (Clatz 2005).
void trim(std::vector<Match>& matches, double share, double scale_mm);

/// Weighted mean of |distance|, mm.
double mean_residual(const std::vector<Match>& matches);

}  // namespace tissuewarp::registration::detail
