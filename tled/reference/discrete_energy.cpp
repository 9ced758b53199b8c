#include "tled/reference/discrete_energy.hpp"

#include "tled/model/internal_force.hpp"
#include "tled/stiffness/stiffness.hpp"

namespace tissuewarp::tled {

using Eigen::Matrix3Xd;
using Eigen::VectorXd;

ElementJacobian smallest_element_jacobian(const DiscreteEnergy& energy, const Matrix3Xd& u) {
    const VectorXd J = energy.jacobians(u);
    Eigen::Index place = 0;
    const double value = J.minCoeff(&place);
    return {value, static_cast<int>(place) / energy.jacobians_per_element()};
}

double LinearTetrahedra::energy(const Matrix3Xd& u) const {
    return elastic_energy(rest_, u);
}

Matrix3Xd LinearTetrahedra::force(const Matrix3Xd& u) const {
    return internal_force(rest_, u);
}

detail::BlockRows LinearTetrahedra::stiffness(const Matrix3Xd& u) const {
    return detail::assembled(detail::stiffness(rest_, u), detail::Triangle::Lower);
}

VectorXd LinearTetrahedra::jacobians(const Matrix3Xd& u) const {
    return tled::jacobians(rest_, u);
}

}  // namespace tissuewarp::tled
