#include "tled/reference.hpp"
#include "tled/detail/parallel.hpp"

#include <Eigen/LU>

#include <numeric>
#include <string>

#include "core/errors.hpp"
#include "tled/detail/hexahedra.hpp"
#include "tled/detail/kinematics.hpp"
#include "tled/detail/stiffness.hpp"

namespace tissuewarp::tled {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::VectorXd;

namespace detail {

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

}  // namespace detail

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

ViscousStresses unstressed(const RestState& rest) {
    ViscousStresses stresses(rest.tet.size() + rest.hexahedra.hex.size());
    if (rest.viscosity.empty()) return stresses;
    const auto assign = [&](const std::vector<MaterialBlock>& blocks, int first) {
        for (const MaterialBlock& block : blocks)
            for (int e = block.begin; e < block.end; ++e)
                stresses[first + e].assign(rest.viscosity[block.material].terms.size(), Matrix3d::Zero());
    };
    assign(rest.blocks, 0);
    assign(rest.hexahedra.blocks, rest.element_count());
    return stresses;
}

ViscousStresses advanced(const RestState& rest, ViscousStresses stresses, const Matrix3Xd& displacement,
                         double interval) {
    if (rest.viscosity.empty()) return stresses;
    const auto advance = [&](std::vector<Matrix3d>& q, int material, const Material& law, const Matrix3d& F) {
        const std::vector<PronyTerm>& terms = rest.viscosity[material].terms;
        if (terms.empty()) return;
        const Matrix3d S = F.inverse() * shear_stress(law, F);
        for (std::size_t k = 0; k < terms.size(); ++k) {
            const auto [g, tau] = terms[k];
            q[k] = -g * std::expm1(-interval / tau) * S + std::exp(-interval / tau) * q[k];
        }
    };
    const std::vector<int> material_of = material_of_elements(rest);
    parallel_for(0, rest.element_count(), [&](int e) {
        advance(stresses[e], material_of[e], detail::element_material(rest, material_of[e], e),
                detail::deformation_gradient(rest, displacement, e));
    });
    const std::vector<int> material_of_hex = material_of_elements(rest.hexahedra.blocks);
    parallel_for(0, rest.hexahedra.count(), [&](int e) {
        advance(stresses[rest.element_count() + e], material_of_hex[e],
                detail::hex_material(rest, material_of_hex[e], e),
                detail::hex_deformation_gradient(rest.hexahedra, displacement, e));
    });
    return stresses;
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

Eigen::SparseMatrix<double> tangent_stiffness(const RestState& rest, const Matrix3Xd& displacement) {
    std::vector<int> all(3 * static_cast<std::size_t>(rest.node_count));
    std::iota(all.begin(), all.end(), 0);
    const detail::Stiffness K = detail::stiffness(rest, displacement);
    return detail::scalar_matrix(detail::assembled(K, detail::Triangle::Full), all, detail::Triangle::Full);
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
