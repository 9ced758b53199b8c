#include "tled/error/hierarchical_tissue.hpp"

#include "tled/model/kinematics.hpp"
#include "tled/parallel/parallel.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include <algorithm>
#include <utility>

namespace tissuewarp::tled::detail {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

using Matrix9 = Eigen::Matrix<double, 9, 9>;

// Of the volumetric to the shear modulus in the tangent, that of ν = 0.475. More would change estimates
// at ν = 0.49 by 5 to 15 % and cost conjugate gradients up to ten times the iterations at 0.4999
// (docs/decisions/discretisation_error.md).
constexpr double largest_ratio = 20.0;

// V (G ⊗ 1) A (G ⊗ 1)ᵀ with the columns of `gradient` the rows of G.
Matrix9 in_local_coordinates(const Matrix9& A, const Matrix3d& gradient, double volume) {
    Matrix9 half = Matrix9::Zero(), result = Matrix9::Zero();
    for (int l = 0; l < 3; ++l) {
        for (int m = 0; m < 3; ++m) half.middleCols<3>(3 * l) += (volume * gradient(m, l)) * A.middleCols<3>(3 * m);
    }
    for (int k = 0; k < 3; ++k) {
        for (int j = 0; j < 3; ++j) result.middleRows<3>(3 * k) += gradient(j, k) * half.middleRows<3>(3 * j);
    }
    return result;
}

Matrix9 positive_part(const Matrix9& A) {
    const Eigen::SelfAdjointEigenSolver<Matrix9> modes(A);
    return modes.eigenvectors() * modes.eigenvalues().cwiseMax(0.0).asDiagonal() * modes.eigenvectors().transpose();
}

// ∂L_p/∂ξ A ∂L_q/∂ξ.
Matrix3d between_hats(const Matrix9& A, int p, int q) {
    Eigen::Matrix<double, 9, 3> half;
    for (int l = 0; l < 3; ++l) half.middleRows<3>(3 * l) = A.block<3, 3>(3 * l, 3 * std::max(q - 1, 0));
    if (q == 0) half = -(A.leftCols<3>() + A.middleCols<3>(3) + A.rightCols<3>());
    if (p > 0) return half.middleRows<3>(3 * (p - 1));
    return -(half.topRows<3>() + half.middleRows<3>(3) + half.bottomRows<3>());
}

/// Calls visit(element, corner a, corner b) for the elements at an edge.
template <class Visit>
void for_each_at(const HierarchicalSpace& space, int edge, const Visit& visit) {
    for (int k = space.incidence.offset[edge]; k < space.incidence.offset[edge + 1]; ++k) {
        const int entry = space.incidence.entry[k];
        visit(entry / 6, tetrahedron_edges[entry % 6][0], tetrahedron_edges[entry % 6][1]);
    }
}

// Σ_a M_a U'' V_a g gᵀ, g the derivative of the averaged J_a by the bubble; few pressure nodes are about an edge.
Matrix3d block_of_averages(const HierarchicalTissue& tissue, int edge) {
    std::vector<std::pair<int, Vector3d>> gradients;  // V_a g, mm²
    for_each_at(tissue.space, edge, [&](int e, int i, int j) {
        if (!tissue.elements[e].averaged) return;
        const Matrix3d rate = tissue.elements[e].volume_rate.reshaped(3, 3);
        const Vector3d at_i = 0.2 * times_hat_gradient(rate, j), at_j = 0.2 * times_hat_gradient(rate, i);
        for (int c = 0; c < 4; ++c) {
            const int a = tissue.rest.pressure.of_element(c, e);
            auto place = std::find_if(gradients.begin(), gradients.end(), [a](const auto& g) { return g.first == a; });
            if (place == gradients.end()) place = gradients.insert(place, {a, Vector3d::Zero()});
            place->second += (c == i ? 2.0 : 1.0) * at_i + (c == j ? 2.0 : 1.0) * at_j;
        }
    });
    Matrix3d block = Matrix3d::Zero();
    for (const auto& [a, g] : gradients) block += tissue.nodal_modulus[a] * g * g.transpose();
    return block;
}

}  // namespace

HierarchicalTissue hierarchical_tissue(const HierarchicalSpace& space, const RestState& rest,
                                       const std::vector<bool>& averaged, const Matrix3Xd& displacement,
                                       Moduli moduli) {
    const std::vector<VolumetricFunction> nodal = nodal_volumetric(rest, element_jacobians(rest, displacement));
    HierarchicalTissue result{space, rest, std::vector<HierarchicalElement>(rest.tet.size()),
                              VectorXd::Zero(rest.pressure.count())};
    for (int a = 0; a < rest.pressure.count(); ++a) {
        if (!averaged[rest.pressure.material[a]]) continue;
        const double most = largest_ratio * shear_modulus(rest.materials[rest.pressure.material[a]]);
        result.nodal_modulus[a] = std::clamp(nodal[a].second, 0.0, most) / rest.pressure.volume[a];
    }
    const std::vector<int> material_of = material_of_elements(rest);
    parallel_for(0, rest.element_count(), [&](int e) {
        const Material material = element_material(rest, material_of[e], e);
        const Matrix3d gradient = rest.gradient.col(e).reshaped(3, 3);
        Tangent tangent = shear_tangent(material, deformation_gradient(rest, displacement, e));
        HierarchicalElement& element = result.elements[e];
        element.averaged = averaged[material_of[e]];
        if (element.averaged) {
            for (int c = 0; c < 4; ++c) element.pressure[c] = nodal[rest.pressure.of_element(c, e)].first;
            add_volumetric_tangent(tangent, element.pressure.mean(), 0.0);
        } else {
            const VolumetricFunction U = volumetric_function(material, tangent.F.determinant());
            const double modulus = volumetric_modulus(material);
            element.pressure.setConstant(modulus * U.first);
            add_volumetric_tangent(tangent, modulus * U.first, modulus * U.second);
        }
        const Matrix9 A = moduli == Moduli::Exact ? tangent.matrix() : positive_part(tangent.matrix());
        element.tangent = in_local_coordinates(A, gradient, rest.volume[e]);
        element.shear = (rest.volume[e] * shear_stress(material, tangent.F) * gradient).reshaped();
        element.volume_rate = (rest.volume[e] * cofactor(tangent.F) * gradient).reshaped();
    });
    return result;
}

// ∫ S : ∇(4 L_a L_b) = 4 (∫ L_a S ∇L_b + ∫ L_b S ∇L_a), where ∫ L_a p = V (p_a + Σ p)/20 for a linear pressure.
Matrix3Xd residual(const HierarchicalTissue& tissue, const VectorXd& pressure) {
    const HierarchicalSpace& space = tissue.space;
    Matrix3Xd result(3, space.size());
    parallel_for(0, space.corner_count, [&](int node) {
        const Incidence& incidence = tissue.rest.incidence;
        Vector3d sum = Vector3d::Zero();
        for (int k = incidence.offset[node]; k < incidence.offset[node + 1]; ++k) {
            const int e = incidence.entry[k] / 4;
            const HierarchicalElement& element = tissue.elements[e];
            sum += (pressure[e] - element.pressure.mean()) *
                   times_hat_gradient(element.volume_rate.reshaped(3, 3), incidence.entry[k] % 4);
        }
        result.col(node) = sum;
    });
    parallel_for(0, space.edge_count(), [&](int edge) {
        Vector3d sum = Vector3d::Zero();
        for_each_at(space, edge, [&](int e, int a, int b) {
            const HierarchicalElement& element = tissue.elements[e];
            const auto moment = [&](int c) {
                const double p = 0.05 * (element.pressure[c] + element.pressure.sum());
                return Matrix3d((0.25 * element.shear + p * element.volume_rate).reshaped(3, 3));
            };
            sum -= 4.0 * (times_hat_gradient(moment(a), b) + times_hat_gradient(moment(b), a));
        });
        result.col(space.corner_count + edge) = sum;
    });
    return result;
}

// ∫ L_a L_b = V (1 + δ_ab)/20.
std::vector<Matrix3d> bubble_blocks(const HierarchicalTissue& tissue) {
    std::vector<Matrix3d> blocks(static_cast<std::size_t>(tissue.space.edge_count()));
    parallel_for(0, tissue.space.edge_count(), [&](int edge) {
        blocks[edge] = block_of_averages(tissue, edge);
        for_each_at(tissue.space, edge, [&](int e, int a, int b) {
            const Matrix9& A = tissue.elements[e].tangent;
            const Matrix3d across = between_hats(A, a, b);
            blocks[edge] += 0.8 * (2.0 * (between_hats(A, a, a) + between_hats(A, b, b)) + across + across.transpose());
        });
    });
    return blocks;
}

}  // namespace tissuewarp::tled::detail
