#include "tled/detail/hierarchical_stiffness.hpp"

#include "tled/detail/kinematics.hpp"
#include "tled/detail/parallel.hpp"

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

// S ∂L_corner/∂ξ for a 3 × 3 matrix S.
template <class Matrix>
Vector3d times_hat_gradient(const Matrix& S, int corner) {
    if (corner > 0) return S.col(corner - 1);
    return -S.rowwise().sum();
}

// D += d ∂L_corner/∂ξ.
template <class Column>
void add_hat_product(Column D, const Vector3d& d, int corner) {
    if (corner > 0) {
        D.template segment<3>(3 * (corner - 1)) += d;
        return;
    }
    for (int k = 0; k < 3; ++k) D.template segment<3>(3 * k) -= d;
}

// ∫ L_a f / V at the corners a for f linear in the element with these values at the corners: (f_a + Σ f) / 20.
template <class Values>
Values moments(const Values& values) {
    return 0.05 * (values.colwise() + values.rowwise().sum());
}

}  // namespace

HierarchicalStiffness::HierarchicalStiffness(const HierarchicalSpace& space, const RestState& rest,
                                             const std::vector<bool>& averaged, const Matrix3Xd& displacement)
    : space_(space), rest_(rest), averaged_(averaged) {
    linearise(displacement);
}

void HierarchicalStiffness::linearise(const Matrix3Xd& displacement) {
    const std::vector<VolumetricFunction> nodal = nodal_volumetric(rest_, element_jacobians(rest_, displacement));
    nodal_modulus_ = VectorXd::Zero(rest_.pressure.count());
    for (int a = 0; a < rest_.pressure.count(); ++a) {
        if (!averaged_[rest_.pressure.material[a]]) continue;
        nodal_modulus_[a] = std::max(0.0, nodal[a].second) / rest_.pressure.volume[a];
    }
    const std::vector<int> material_of = material_of_elements(rest_);
    elements_.resize(rest_.tet.size());
    shear_.resize(rest_.tet.size());
    pressure_.resize(4, rest_.element_count());
    parallel_for(0, rest_.element_count(), [&](int e) {
        const Material material = element_material(rest_, material_of[e], e);
        const Matrix3d gradient = rest_.gradient.col(e).reshaped(3, 3);
        Tangent tangent = shear_tangent(material, deformation_gradient(rest_, displacement, e));
        HierarchicalElement& element = elements_[e];
        element.averaged = averaged_[material_of[e]];
        if (element.averaged) {
            for (int c = 0; c < 4; ++c) pressure_(c, e) = nodal[rest_.pressure.of_element(c, e)].first;
            add_volumetric_tangent(tangent, pressure_.col(e).mean(), 0.0);
        } else {
            const VolumetricFunction U = volumetric_function(material, tangent.F.determinant());
            const double modulus = volumetric_modulus(material);
            pressure_.col(e).setConstant(modulus * U.first);
            add_volumetric_tangent(tangent, modulus * U.first, modulus * U.second);
        }
        element.tangent = in_local_coordinates(tangent.matrix(), gradient, rest_.volume[e]);
        element.volume_rate = (rest_.volume[e] * cofactor(tangent.F) * gradient).reshaped();
        shear_[e] = (rest_.volume[e] * shear_stress(material, tangent.F) * gradient).reshaped();
    });
}

namespace {

// ∫ S : ∇N over an element, S linear in it with these values at the corners, in local coordinates.
Eigen::Matrix<double, 3, 10> nodal_forces(const Eigen::Matrix<double, 9, 4>& corners) {
    Eigen::Matrix<double, 3, 10> f;
    const Matrix3d mean = (0.25 * corners.rowwise().sum()).reshaped(3, 3);
    for (int c = 0; c < 4; ++c) f.col(c) = times_hat_gradient(mean, c);
    const Eigen::Matrix<double, 9, 4> moment = moments(corners);
    for (int k = 0; k < 6; ++k) {
        const auto [a, b] = tetrahedron_edges[k];
        f.col(4 + k) = 4.0 * (times_hat_gradient(moment.col(a).reshaped(3, 3), b) +
                              times_hat_gradient(moment.col(b).reshaped(3, 3), a));
    }
    return f;
}

}  // namespace

Matrix3Xd HierarchicalStiffness::gathered(const std::vector<Forces>& forces) const {
    Matrix3Xd result(3, space_.size());
    parallel_for(0, space_.size(), [&](int i) {
        const bool is_corner = i < space_.corner_count;
        const Incidence& incidence = is_corner ? rest_.incidence : space_.incidence;
        const int row = is_corner ? i : i - space_.corner_count, places = is_corner ? 4 : 6, first = is_corner ? 0 : 4;
        Vector3d sum = Vector3d::Zero();
        for (int k = incidence.offset[row]; k < incidence.offset[row + 1]; ++k) {
            sum += forces[incidence.entry[k] / places].col(first + incidence.entry[k] % places);
        }
        result.col(i) = sum;
    });
    return result;
}

Matrix3Xd HierarchicalStiffness::residual(const VectorXd& pressure) const {
    std::vector<Forces> forces(elements_.size());
    parallel_for(0, static_cast<int>(elements_.size()), [&](int e) {
        Corners9 stress;  // at the corners of the element
        for (int c = 0; c < 4; ++c) stress.col(c) = -shear_[e] - pressure_(c, e) * elements_[e].volume_rate;
        forces[e] = nodal_forces(stress);
        const Matrix3d less = ((pressure[e] - pressure_.col(e).mean()) * elements_[e].volume_rate).reshaped(3, 3);
        for (int c = 0; c < 4; ++c) forces[e].col(c) = times_hat_gradient(less, c);
    });
    return gathered(forces);
}

HierarchicalStiffness::Corners9 HierarchicalStiffness::derivatives(const Matrix3Xd& x, int element) const {
    const auto nodes = rest_.nodes.col(element);
    Vector9 linear;
    for (int k = 0; k < 3; ++k) linear.segment<3>(3 * k) = x.col(nodes[k + 1]) - x.col(nodes[0]);
    Corners9 D = linear.replicate<1, 4>();
    for (int k = 0; k < 6; ++k) {
        const auto [a, b] = tetrahedron_edges[k];
        const Vector3d bubble = 4.0 * x.col(space_.corner_count + space_.edge_of(k, element));
        add_hat_product(D.col(a), bubble, b);
        add_hat_product(D.col(b), bubble, a);
    }
    return D;
}

VectorXd HierarchicalStiffness::nodal_rates(const Matrix3Xd& x) const {
    Eigen::Matrix4Xd rate(4, rest_.element_count());  // ∫ L_a cof F : ∇x, mm³
    parallel_for(0, rest_.element_count(), [&](int e) {
        if (!elements_[e].averaged) return;
        rate.col(e) = moments(derivatives(x, e)).transpose() * elements_[e].volume_rate;
    });
    VectorXd result = VectorXd::Zero(rest_.pressure.count());
    parallel_for(0, rest_.pressure.count(), [&](int a) {
        if (nodal_modulus_[a] == 0.0) return;
        const Incidence& incidence = rest_.pressure.incidence;
        for (int k = incidence.offset[a]; k < incidence.offset[a + 1]; ++k) {
            result[a] += nodal_modulus_[a] * rate.reshaped()[incidence.entry[k]];
        }
    });
    return result;
}

Matrix3Xd HierarchicalStiffness::multiply(const Matrix3Xd& x) const {
    const bool any_averaged = std::find(averaged_.begin(), averaged_.end(), true) != averaged_.end();
    const VectorXd rates = any_averaged ? nodal_rates(x) : VectorXd();
    std::vector<Forces> forces(elements_.size());
    parallel_for(0, static_cast<int>(elements_.size()), [&](int e) {
        const HierarchicalElement& element = elements_[e];
        Corners9 stress = element.tangent * derivatives(x, e);
        if (element.averaged) {
            for (int c = 0; c < 4; ++c) stress.col(c) += rates[rest_.pressure.of_element(c, e)] * element.volume_rate;
        }
        forces[e] = nodal_forces(stress);
    });
    return gathered(forces);
}

std::vector<Matrix3d> HierarchicalStiffness::bubble_blocks() const {
    std::vector<Matrix3d> blocks(static_cast<std::size_t>(space_.edge_count()));
    parallel_for(0, space_.edge_count(), [&](int edge) {
        Matrix3d& block = blocks[edge];
        block.setZero();
        for (int k = space_.incidence.offset[edge]; k < space_.incidence.offset[edge + 1]; ++k) {
            const int e = space_.incidence.entry[k] / 6;
            const auto [a, b] = tetrahedron_edges[space_.incidence.entry[k] % 6];
            // Σ ∂L_p/∂ξ A ∂L_q/∂ξ
            const auto product = [&, &A = elements_[e].tangent](int p, int q) {
                Eigen::Matrix<double, 9, 3> half = Eigen::Matrix<double, 9, 3>::Zero();
                for (int l = 0; l < 3; ++l) {
                    if (q == 0) half -= A.middleCols<3>(3 * l);
                    if (q == l + 1) half += A.middleCols<3>(3 * l);
                }
                Matrix3d result = Matrix3d::Zero();
                for (int l = 0; l < 3; ++l) {
                    if (p == 0) result -= half.middleRows<3>(3 * l);
                    if (p == l + 1) result += half.middleRows<3>(3 * l);
                }
                return result;
            };
            block += 0.8 * (2.0 * product(a, a) + 2.0 * product(b, b) + product(a, b) + product(b, a));
        }
    });
    add_averages(blocks);
    return blocks;
}

// Σ_a M_a U'' V_a g g ᵀ, g the derivative of the averaged J by the bubble.
void HierarchicalStiffness::add_averages(std::vector<Matrix3d>& blocks) const {
    parallel_for(0, space_.edge_count(), [&](int edge) {
        std::vector<std::pair<int, Vector3d>> gradients;  // of the few pressure nodes about the edge, mm²
        for (int k = space_.incidence.offset[edge]; k < space_.incidence.offset[edge + 1]; ++k) {
            const int e = space_.incidence.entry[k] / 6;
            if (!elements_[e].averaged) continue;
            const auto [i, j] = tetrahedron_edges[space_.incidence.entry[k] % 6];
            const Matrix3d rate = elements_[e].volume_rate.reshaped(3, 3);
            const Vector3d by_i = 0.2 * times_hat_gradient(rate, j), by_j = 0.2 * times_hat_gradient(rate, i);
            for (int c = 0; c < 4; ++c) {
                const int a = rest_.pressure.of_element(c, e);
                auto place =
                    std::find_if(gradients.begin(), gradients.end(), [a](const auto& g) { return g.first == a; });
                if (place == gradients.end()) place = gradients.insert(place, {a, Vector3d::Zero()});
                place->second += (c == i ? 2.0 : 1.0) * by_i + (c == j ? 2.0 : 1.0) * by_j;
            }
        }
        for (const auto& [a, g] : gradients) blocks[edge] += nodal_modulus_[a] * g * g.transpose();
    });
}

}  // namespace tissuewarp::tled::detail
