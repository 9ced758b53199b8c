#pragma once
/// Loads of the tissue as forces on nodes.

#include "registration/pipeline.hpp"

namespace tissuewarp::registration::detail {

/// mN, 3 × N: the body force times the volume lumped to each node, and the pressure on the outer faces at rest. Throws
/// InvalidInput for loads that are not finite.
Eigen::Matrix3Xd nodal_forces(const PreparedModel& prepared, const TissueLoads& loads);

}  // namespace tissuewarp::registration::detail
