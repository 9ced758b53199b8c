#include "tled/model/kinematics.hpp"

#include "core/errors.hpp"
#include "tled/parallel/parallel.hpp"

#include <Eigen/LU>

#include <string>

namespace tissuewarp::tled::detail {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::VectorXd;

Eigen::Matrix<double, 3, 4> shape_gradients(const RestState& rest, int element) {
    Eigen::Matrix<double, 3, 4> result;
    result.rightCols<3>() = rest.gradient.col(element).reshaped(3, 3);
    result.col(0) = -result.rightCols<3>().rowwise().sum();
    return result;
}

Matrix3d deformation_gradient(const RestState& rest, const Matrix3Xd& displacement, int element) {
    const Eigen::Vector4i nodes = rest.nodes.col(element);
    Matrix3d edges;
    for (int k = 0; k < 3; ++k) edges.col(k) = displacement.col(nodes[k + 1]) - displacement.col(nodes[0]);
    return Matrix3d::Identity() + edges * rest.gradient.col(element).reshaped(3, 3).transpose();
}

Material element_material(const RestState& rest, int material, int element) {
    Material result = rest.materials[static_cast<std::size_t>(material)];
    if (auto* fibrous = std::get_if<TransverselyIsotropic>(&result)) fibrous->fibre = rest.fibre.col(element);
    return result;
}

VectorXd element_jacobians(const RestState& rest, const Matrix3Xd& displacement) {
    VectorXd result(rest.element_count());
    parallel_for(0, rest.element_count(),
                 [&](int e) { result[e] = deformation_gradient(rest, displacement, e).determinant(); });
    return result;
}

std::vector<VolumetricFunction> nodal_volumetric(const RestState& rest, const VectorXd& jacobian) {
    std::vector<VolumetricFunction> result(rest.pressure.count());
    parallel_for(0, rest.pressure.count(), [&](int a) {
        const Incidence& incidence = rest.pressure.incidence;
        double volume = 0.0;
        for (int k = incidence.offset[a]; k < incidence.offset[a + 1]; ++k) {
            const int e = incidence.entry[k] / 4;
            volume += 0.25 * rest.volume[e] * jacobian[e];
        }
        const double modulus = rest.pressure.modulus[a];
        const Material& material = rest.materials[static_cast<std::size_t>(rest.pressure.material[a])];
        const VolumetricFunction U = volumetric_function(material, volume / rest.pressure.volume[a]);
        result[a] = {modulus * U.energy, modulus * U.first, modulus * U.second};
    });
    return result;
}

double element_pressure(const RestState& rest, int element, const Material& material, double J,
                        const std::vector<VolumetricFunction>& nodal) {
    double pressure = rest.volumetric_modulus[element] * volumetric_function(material, J).first;
    if (nodal.empty()) return pressure;
    for (int corner = 0; corner < 4; ++corner)
        pressure += 0.25 * nodal[rest.pressure.of_element(corner, element)].first;
    return pressure;
}

void require_positive(const RestState& rest, const VectorXd& jacobian) {
    const std::vector<int> material_of = material_of_elements(rest);
    for (int e = 0; e < jacobian.size(); ++e) {
        if (jacobian[e] > 0.0 || admits_inversion(rest.materials[material_of[e]])) continue;
        throw SolverFailure("tetrahedron " + std::to_string(rest.tet[e]) +
                            " has det F = " + std::to_string(jacobian[e]) +
                            ", which must be positive for a stress: apply the load in smaller steps");
    }
}

}  // namespace tissuewarp::tled::detail
