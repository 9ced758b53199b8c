#include "tled/model/hexahedra.hpp"
#include "tled/parallel/parallel.hpp"

#include <Eigen/LU>

#include <string>

#include "core/errors.hpp"

namespace tissuewarp::tled::detail {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::VectorXd;
using Matrix38 = Eigen::Matrix<double, 3, 8>;
using Matrix84 = Eigen::Matrix<double, 8, 4>;

namespace {

Matrix84 base_vectors() {
    Matrix84 base;
    for (int alpha = 0; alpha < 4; ++alpha)
        for (int corner = 0; corner < 8; ++corner) base(corner, alpha) = hourglass_base[alpha][corner];
    return base;
}

Matrix38 corner_displacements(const HexState& state, const Matrix3Xd& displacement, int element) {
    Matrix38 u;
    for (int corner = 0; corner < 8; ++corner) u.col(corner) = displacement.col(state.nodes(corner, element));
    return u;
}

}  // namespace

void precompute_hexahedra(const Model& model, const std::vector<Material>& materials, HexState& state,
                          VectorXd& lumped_mass) {
    const int count = state.count();
    const std::vector<meshing::FaceShapes> shapes = meshing::face_shapes(model.mesh, model.hexahedra);
    const std::vector<int> material_of = material_of_elements(state.blocks);
    const Matrix84 base = base_vectors();
    state.nodes.resize(8, count);
    state.gradient.resize(21, count);
    state.volume.resize(count);
    state.volumetric_modulus.resize(count);
    state.rest_hourglass.resize(12, count);
    state.hourglass_stiffness.resize(count);
    for (int e = 0; e < count; ++e) {
        const int hex = state.hex[static_cast<std::size_t>(e)];
        state.nodes.col(e) = model.hexahedra.hexes.col(hex);
        Matrix38 X = meshing::hex_corners(model.mesh.nodes, model.hexahedra, hex);
        X.colwise() -= Eigen::Vector3d(X.col(0));  // so that no digits are lost far from the origin
        const Matrix38 B = meshing::surface_gradient(X, shapes[static_cast<std::size_t>(hex)]);
        const double volume = B.cwiseProduct(X).sum() / 3;
        state.volume[e] = volume;
        state.gradient.col(e) = (B / volume).rightCols<7>().reshaped();
        state.rest_hourglass.col(e) = (X * base).reshaped();
        const Material& material = materials[static_cast<std::size_t>(material_of[static_cast<std::size_t>(e)])];
        state.volumetric_modulus[e] = volumetric_modulus(material);
        state.hourglass_stiffness[e] = model.hourglass_coefficient * shear_modulus(material) * B.squaredNorm() / volume;
        for (const int node : state.nodes.col(e)) lumped_mass[node] += model.density * volume / 8;
    }
}

Matrix38 hex_shape_gradients(const HexState& state, int element) {
    Matrix38 result;
    result.rightCols<7>() = state.gradient.col(element).reshaped(3, 7);
    result.col(0) = -result.rightCols<7>().rowwise().sum();
    return result;
}

Matrix84 hourglass_vectors(const HexState& state, int element) {
    return base_vectors() -
           hex_shape_gradients(state, element).transpose() * state.rest_hourglass.col(element).reshaped(3, 4);
}

Matrix3d hex_deformation_gradient(const HexState& state, const Matrix3Xd& displacement, int element) {
    return Matrix3d::Identity() +
           corner_displacements(state, displacement, element) * hex_shape_gradients(state, element).transpose();
}

Material hex_material(const RestState& rest, int material, int element) {
    Material result = rest.materials[static_cast<std::size_t>(material)];
    if (auto* fibrous = std::get_if<TransverselyIsotropic>(&result)) fibrous->fibre = rest.hexahedra.fibre.col(element);
    return result;
}

VectorXd hex_jacobians(const HexState& state, const Matrix3Xd& displacement) {
    VectorXd result(state.count());
    parallel_for(0, state.count(),
                 [&](int e) { result[e] = hex_deformation_gradient(state, displacement, e).determinant(); });
    return result;
}

double hex_energy(const RestState& rest, const Matrix3Xd& displacement) {
    const HexState& state = rest.hexahedra;
    const std::vector<int> material_of = material_of_elements(state.blocks);
    VectorXd energy(state.count());
    parallel_for(0, state.count(), [&](int e) {
        const Material material = hex_material(rest, material_of[static_cast<std::size_t>(e)], e);
        const Matrix3d F = hex_deformation_gradient(state, displacement, e);
        const Eigen::Matrix<double, 3, 4> q =
            corner_displacements(state, displacement, e) * hourglass_vectors(state, e);
        energy[e] = state.volume[e] * strain_energy(material, F) + 0.5 * state.hourglass_stiffness[e] * q.squaredNorm();
    });
    double sum = 0.0;
    for (const double part : energy) sum += part;
    return sum;
}

Matrix3Xd hex_corner_forces(const RestState& rest, const Matrix3Xd& displacement, const ViscousStresses& stresses) {
    const HexState& state = rest.hexahedra;
    const std::vector<int> material_of = material_of_elements(state.blocks);
    Matrix3Xd force(3, 8 * state.count());
    parallel_for(0, state.count(), [&](int e) {
        const Material material = hex_material(rest, material_of[static_cast<std::size_t>(e)], e);
        const Matrix3d F = hex_deformation_gradient(state, displacement, e);
        Matrix3d P = first_piola_kirchhoff_stress(material, F);
        for (const Matrix3d& q : stresses[static_cast<std::size_t>(rest.element_count() + e)]) P -= F * q;
        const Matrix84 gamma = hourglass_vectors(state, e);
        const Eigen::Matrix<double, 3, 4> q = corner_displacements(state, displacement, e) * gamma;
        force.middleCols<8>(8 * e) =
            state.volume[e] * P * hex_shape_gradients(state, e) + state.hourglass_stiffness[e] * q * gamma.transpose();
    });
    return force;
}

void require_positive_hexahedra(const RestState& rest, const VectorXd& jacobian) {
    const std::vector<int> material_of = material_of_elements(rest.hexahedra.blocks);
    for (int e = 0; e < jacobian.size(); ++e) {
        const auto at = static_cast<std::size_t>(e);
        if (jacobian[e] > 0.0 || admits_inversion(rest.materials[static_cast<std::size_t>(material_of[at])])) continue;
        throw SolverFailure("hexahedron " + std::to_string(rest.hexahedra.hex[at]) +
                            " has det F = " + std::to_string(jacobian[e]) +
                            ", which must be positive for a stress: apply the load in smaller steps");
    }
}

}  // namespace tissuewarp::tled::detail
