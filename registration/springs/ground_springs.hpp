#pragma once
/// What holds tissue of which no datum says where it went.

#include "registration/options.hpp"
#include "registration/prepare.hpp"
#include "registration/result.hpp"

#include <functional>

namespace tissuewarp::registration::detail {

/// The strain energy (mN mm) that weighs as much as one standard deviation of a datum: E ε² ℓ³ of the expected strain
/// ε of pieces of tissue of size ℓ.
double strain_energy_unit(const PreparedModel& prepared, const TissuePrior& tissue);

struct GroundOptions {
    double independent_area = 100.0;  ///< mm² that move on their own. Chosen by hand; on which data is not recorded
};
inline constexpr GroundOptions ground_options{};

/// How far a surface is expected to move, mm: standard deviations along its normal at rest, and in its tangent plane.
struct ExpectedMotion {
    double across_mm, along_mm;

    ExpectedMotion(double any_way_mm) : across_mm(any_way_mm), along_mm(any_way_mm) {}
    ExpectedMotion(double across, double along) : across_mm(across), along_mm(along) {}
};

/// Weak springs from every node of the outer surface to where the rigid placement has it: the prior that it moved as
/// far as `expected` says of it, the wall of a cavity and surfaces that slide as far as they like. `energy` is the strain energy (mN mm) that
/// weighs as much as one standard deviation.
std::vector<tled::Spring> ground_springs(const PreparedModel& prepared, double energy,
                                         const std::function<ExpectedMotion(const InterfaceNode&)>& expected);

/// Pulls with the prior replaced by ground_springs() of a free organ: what is known without any datum.
void expect_free_motion(LastPulls& pulls, const PreparedModel& prepared, double motion_mm);

}  // namespace tissuewarp::registration::detail
