// Second derivative of the energy of quadratic tetrahedra: the elements' part and, for averaged pressure, the products
// of the gradients of the averages.

#include "tled/material/constitutive.hpp"
#include "tled/reference/quadratic.hpp"
#include "tled/stiffness/stiffness.hpp"

#include <map>

namespace tissuewarp::tled {

using Eigen::Matrix3Xd;
using Eigen::VectorXd;

// ∇J_a = ∫ L_a cof F ∇N / ∫ L_a over the elements around a.
void QuadraticTetrahedra::add_pressure_rows(const Matrix3Xd& u, const VectorXd& J, detail::RankOneRows& rows) const {
    rows.offset.push_back(0);
    rows.stiffness.resize(static_cast<Eigen::Index>(pressure_nodes_.size()));
    for (int a = 0; a < static_cast<int>(pressure_nodes_.size()); ++a) {
        const PressureNode& node = pressure_nodes_[static_cast<std::size_t>(a)];
        std::map<int, Eigen::Vector3d> gradient;
        for (const auto& [e, corner] : node.elements) {
            Gradients sum = Gradients::Zero();
            for (int q = 0; q < points_; ++q) {
                const int point = e * points_ + q;
                sum += weight_[point] * hat_[static_cast<std::size_t>(q)][corner] / node.volume *
                       cofactor(deformation_gradient(u, e, q)) * gradient_[static_cast<std::size_t>(point)];
            }
            for (int c = 0; c < 10; ++c) {
                gradient.try_emplace(tets_(c, e), Eigen::Vector3d::Zero()).first->second += sum.col(c);
            }
        }
        for (const auto& [i, g] : gradient) {
            rows.node.push_back(i);
            rows.gradient.push_back(g);
        }
        rows.offset.push_back(static_cast<int>(rows.node.size()));
        rows.stiffness[a] = node.volume * volumetric_modulus(node.material) *
                            volumetric_function(node.material, nodal_jacobian(a, J)).second;
    }
    detail::list_by_node(node_count_, rows);
}

detail::BlockRows QuadraticTetrahedra::stiffness(const Matrix3Xd& u) const {
    const VectorXd J = checked_jacobians(u), nodal = nodal_pressure(J);
    detail::Stiffness K;
    K.elements.offset = row_offset_;
    K.elements.column = row_column_;
    K.elements.block.assign(row_column_.size(), Eigen::Matrix3d::Zero());
    add_element_matrices(u, J, nodal, K.elements);
    K.products.node_offset.assign(static_cast<std::size_t>(node_count_) + 1, 0);
    if (pressure_ == QuadraticPressure::NodalAverage) add_pressure_rows(u, J, K.products);
    return detail::assembled(K, detail::Triangle::Lower);
}

}  // namespace tissuewarp::tled
