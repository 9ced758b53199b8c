#include "tled/error/lifted_residual.hpp"

#include "tled/model/internal_force.hpp"
#include "tled/model/springs.hpp"

namespace tissuewarp::tled {

using Eigen::Matrix3Xd;

Matrix3Xd lifted_residual(const RestState& rest, const RestStiffness& stiffness, const NodalConditions& conditions,
                          const Matrix3Xd& displacement) {
    constexpr double tolerance = 1e-3;  // where the springs are not those factorised
    Matrix3Xd resistance = internal_force(rest, displacement);
    detail::add_spring_resistance(conditions, displacement, resistance);
    Matrix3Xd residual = detail::applied_force(conditions) - resistance;
    const NodalEffects& effects = conditions.effects;
    if (!effects.surface.empty()) residual += surface_force(effects.surface, rest.position, displacement);
    if (effects.fluid) residual += fluid_force(*effects.fluid, displacement);
    return stiffness.solve_iteratively(residual, conditions, tolerance);
}

}  // namespace tissuewarp::tled
