#include "tled/model/internal_force.hpp"

#include "tled/model/hexahedra.hpp"
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
    double sum = std::accumulate(energy.begin(), energy.end(), 0.0) + detail::hex_energy(rest, displacement);
    const std::vector<VolumetricFunction> nodal = detail::nodal_volumetric(rest, jacobian);
    for (int a = 0; a < rest.pressure.count(); ++a) sum += rest.pressure.volume[a] * nodal[a].energy;
    return sum;
}

Matrix3Xd internal_force(const RestState& rest, const Matrix3Xd& displacement) {
    return internal_force(rest, displacement, ViscousStresses(rest.tet.size() + rest.hexahedra.hex.size()));
}

Matrix3Xd internal_force(const RestState& rest, const Matrix3Xd& displacement, const ViscousStresses& stresses) {
    const VectorXd jacobian = detail::element_jacobians(rest, displacement);
    detail::require_positive(rest, jacobian);
    detail::require_positive_hexahedra(rest, detail::hex_jacobians(rest.hexahedra, displacement));
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
    const auto gather = [&](const Incidence& incidence, const Matrix3Xd& corners) {
        parallel_for(0, rest.node_count, [&](int a) {
            for (int k = incidence.offset[a]; k < incidence.offset[a + 1]; ++k) {
                force.col(a) += corners.col(incidence.entry[k]);
            }
        });
    };
    gather(rest.incidence, corner_force);
    if (rest.hexahedra.count() > 0) {
        gather(rest.hexahedra.incidence, detail::hex_corner_forces(rest, displacement, stresses));
    }
    return force;
}

VectorXd jacobians(const RestState& rest, const Matrix3Xd& displacement) {
    const VectorXd internal = detail::element_jacobians(rest, displacement);
    const VectorXd hexahedra = detail::hex_jacobians(rest.hexahedra, displacement);
    VectorXd result(internal.size() + hexahedra.size());
    for (int e = 0; e < internal.size(); ++e) result[rest.tet[e]] = internal[e];
    for (int e = 0; e < hexahedra.size(); ++e) result[internal.size() + rest.hexahedra.hex[e]] = hexahedra[e];
    return result;
}

}  // namespace tissuewarp::tled
