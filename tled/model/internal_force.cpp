#include "tled/model/internal_force.hpp"

#include "tled/model/kinematics.hpp"
#include "tled/parallel/parallel.hpp"

#include <Eigen/LU>

#include <numeric>

namespace tissuewarp::tled {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::VectorXd;

double elastic_energy(const RestState& rest, const Matrix3Xd& displacement) {
    const std::vector<int> material_of = material_of_elements(rest);
    VectorXd energy(rest.element_count()), jacobian(rest.element_count());
    parallel_for(0, rest.element_count(), [&](int e) {
        const Material material = detail::element_material(rest, material_of[e], e);
        const Matrix3d F = detail::deformation_gradient(rest, displacement, e);
        jacobian[e] = F.determinant();
        energy[e] = rest.volume[e] * shear_energy(material, F);
        if (rest.volumetric_modulus[e] > 0.0)
            energy[e] +=
                rest.volume[e] * rest.volumetric_modulus[e] * volumetric_function(material, jacobian[e]).energy;
    });
    double sum = std::accumulate(energy.begin(), energy.end(), 0.0);
    const std::vector<VolumetricFunction> nodal = detail::nodal_volumetric(rest, jacobian);
    for (int a = 0; a < rest.pressure.count(); ++a) sum += rest.pressure.volume[a] * nodal[a].energy;
    return sum;
}

Matrix3Xd internal_force(const RestState& rest, const Matrix3Xd& displacement) {
    return internal_force(rest, displacement, ViscousStresses(rest.tet.size()));
}

Matrix3Xd internal_force(const RestState& rest, const Matrix3Xd& displacement, const ViscousStresses& stresses) {
    const VectorXd jacobian = detail::element_jacobians(rest, displacement);
    detail::require_positive(rest, jacobian);
    const std::vector<VolumetricFunction> nodal = detail::nodal_volumetric(rest, jacobian);
    const std::vector<int> material_of = material_of_elements(rest);

    Matrix3Xd corner_force(3, 4 * rest.element_count());
    parallel_for(0, rest.element_count(), [&](int e) {
        const Material material = detail::element_material(rest, material_of[e], e);
        const Matrix3d F = detail::deformation_gradient(rest, displacement, e);
        const double pressure = detail::element_pressure(rest, e, material, jacobian[e], nodal);
        Matrix3d P = shear_stress(material, F) + pressure * cofactor(F);
        for (const Matrix3d& q : stresses[e]) P -= F * q;
        corner_force.middleCols<4>(4 * e) = rest.volume[e] * P * detail::shape_gradients(rest, e);
    });

    Matrix3Xd force = Matrix3Xd::Zero(3, rest.node_count);
    parallel_for(0, rest.node_count, [&](int a) {
        for (int k = rest.incidence.offset[a]; k < rest.incidence.offset[a + 1]; ++k) {
            force.col(a) += corner_force.col(rest.incidence.entry[k]);
        }
    });
    return force;
}

VectorXd jacobians(const RestState& rest, const Matrix3Xd& displacement) {
    const VectorXd internal = detail::element_jacobians(rest, displacement);
    VectorXd result(internal.size());
    for (int e = 0; e < internal.size(); ++e) result[rest.tet[e]] = internal[e];
    return result;
}

}  // namespace tissuewarp::tled
