#pragma once
/// What holds tissue of which no datum says where it went.

#include "registration/detail/evidence.hpp"

#include <functional>

namespace tissuewarp::registration::detail {

/// The strain energy (mN mm) that weighs as much as one standard deviation of a datum: E ε² ℓ³ of the expected strain
/// ε of pieces of tissue of size ℓ.
double strain_energy_unit(const PreparedModel& prepared, const TissuePrior& tissue);

/// Weak springs from every node of the outer surface to where the rigid placement has it: the prior that it moved by
/// about `expected_mm` of it. `energy` is the strain energy (mN mm) that weighs as much as one standard deviation.
std::vector<tled::Spring> ground_springs(const PreparedModel& prepared, double energy,
                                         const std::function<double(const InterfaceNode&)>& expected_mm);

}  // namespace tissuewarp::registration::detail
