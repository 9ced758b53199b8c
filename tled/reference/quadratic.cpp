#include "tled/reference/quadratic.hpp"
#include "tled/parallel/parallel.hpp"

#include "core/errors.hpp"
#include "tled/material/constitutive.hpp"
#include "tled/reference/quadrature.hpp"
#include "tled/stiffness/stiffness.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <string>

namespace tissuewarp::tled {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::VectorXd;

QuadraticTetrahedra::QuadraticTetrahedra(const QuadraticMesh& mesh, const MaterialTable& materials,
                                         const QuadraticOptions& options)
    : node_count_(mesh.node_count()), tets_(mesh.tets), pressure_(options.pressure) {
    for (const int label : mesh.labels) {
        const auto material = materials.find(label);
        if (material == materials.end()) {
            throw InvalidInput("label " + std::to_string(label) + " has no material; give it one");
        }
        material_.push_back(material->second);
    }
    locate_points(mesh, options.quadrature);
    if (pressure_ == QuadraticPressure::NodalAverage) build_pressure_nodes(mesh, materials);
    build_pattern();
}

void QuadraticTetrahedra::locate_points(const QuadraticMesh& mesh, Quadrature quadrature) {
    const std::vector<detail::QuadraturePoint> rule = detail::tetrahedron_rule(quadrature);
    points_ = static_cast<int>(rule.size());
    weight_.resize(Eigen::Index{points_} * mesh.tet_count());
    for (const detail::QuadraturePoint& point : rule) {
        hat_.emplace_back(1.0 - point.local.sum(), point.local[0], point.local[1], point.local[2]);
    }
    for (int e = 0; e < mesh.tet_count(); ++e) {
        Gradients X;
        for (int c = 0; c < 10; ++c) X.col(c) = mesh.nodes.col(tets_(c, e));
        for (const detail::QuadraturePoint& point : rule) {
            const Eigen::Matrix<double, 10, 3> derivatives = quadratic_shape_derivatives(point.local);
            const Matrix3d map = X * derivatives;  // ∂X/∂ξ
            if (!(map.determinant() > 0.0)) {
                throw InvalidInput("quadratic tetrahedron " + std::to_string(e) +
                                   " is turned inside out at rest; refine the mesh or leave its edges straight");
            }
            weight_[static_cast<Eigen::Index>(gradient_.size())] = point.weight * map.determinant();
            gradient_.emplace_back((derivatives * map.inverse()).transpose());
        }
    }
}

void QuadraticTetrahedra::build_pressure_nodes(const QuadraticMesh& mesh, const MaterialTable& materials) {
    std::map<std::pair<int, int>, int> index;  // (corner, label)
    pressure_node_of_.resize(4, mesh.tet_count());
    for (int e = 0; e < mesh.tet_count(); ++e) {
        for (int c = 0; c < 4; ++c) {
            const auto [place, is_new] =
                index.emplace(std::pair{tets_(c, e), mesh.labels[e]}, static_cast<int>(pressure_nodes_.size()));
            if (is_new) pressure_nodes_.push_back({0.0, materials.at(mesh.labels[e]), {}});
            PressureNode& node = pressure_nodes_[static_cast<std::size_t>(place->second)];
            pressure_node_of_(c, e) = place->second;
            node.elements.emplace_back(e, c);
            for (int q = 0; q < points_; ++q) node.volume += weight_[e * points_ + q] * hat_[q][c];
        }
    }
}

void QuadraticTetrahedra::build_pattern() {
    std::vector<std::vector<int>> neighbours(static_cast<std::size_t>(node_count_));
    for (int e = 0; e < tets_.cols(); ++e) {
        for (const int a : tets_.col(e)) {
            for (const int b : tets_.col(e)) neighbours[static_cast<std::size_t>(a)].push_back(b);
        }
    }
    row_offset_.push_back(0);
    for (std::vector<int>& row : neighbours) {
        std::sort(row.begin(), row.end());
        row.erase(std::unique(row.begin(), row.end()), row.end());
        row_column_.insert(row_column_.end(), row.begin(), row.end());
        row_offset_.push_back(static_cast<int>(row_column_.size()));
    }
}

Matrix3d QuadraticTetrahedra::deformation_gradient(const Matrix3Xd& u, int element, int point) const {
    const Gradients& gradient = gradient_[static_cast<std::size_t>(element * points_ + point)];
    Matrix3d F = Matrix3d::Identity();
    for (int c = 0; c < 10; ++c) F += u.col(tets_(c, element)) * gradient.col(c).transpose();
    return F;
}

VectorXd QuadraticTetrahedra::jacobians(const Matrix3Xd& u) const {
    VectorXd J(weight_.size());
    parallel_for(0, static_cast<int>(tets_.cols()), [&](int e) {
        for (int q = 0; q < points_; ++q) J[e * points_ + q] = deformation_gradient(u, e, q).determinant();
    });
    return J;
}

VectorXd QuadraticTetrahedra::checked_jacobians(const Matrix3Xd& u) const {
    VectorXd J = jacobians(u);
    Eigen::Index place = 0;
    if (!(J.minCoeff(&place) > 0.0)) {
        throw SolverFailure("quadratic tetrahedron " + std::to_string(place / points_) +
                            " has det F = " + std::to_string(J[place]) +
                            ", which must be positive for a stress: apply the load in smaller steps");
    }
    return J;
}

double QuadraticTetrahedra::nodal_jacobian(int a, const VectorXd& J) const {
    const PressureNode& node = pressure_nodes_[static_cast<std::size_t>(a)];
    double volume = 0.0;
    for (const auto& [e, corner] : node.elements) {
        for (int q = 0; q < points_; ++q) {
            volume += weight_[e * points_ + q] * hat_[static_cast<std::size_t>(q)][corner] * J[e * points_ + q];
        }
    }
    return volume / node.volume;
}

VectorXd QuadraticTetrahedra::nodal_pressure(const VectorXd& J) const {
    VectorXd result(static_cast<Eigen::Index>(pressure_nodes_.size()));
    parallel_for(0, static_cast<int>(result.size()), [&](int a) {
        const Material& material = pressure_nodes_[static_cast<std::size_t>(a)].material;
        result[a] = volumetric_modulus(material) * volumetric_function(material, nodal_jacobian(a, J)).first;
    });
    return result;
}

double QuadraticTetrahedra::pressure_at(int element, int point, double J, const VectorXd& nodal) const {
    if (pressure_ == QuadraticPressure::Pointwise) {
        const Material& material = material_[static_cast<std::size_t>(element)];
        return volumetric_modulus(material) * volumetric_function(material, J).first;
    }
    double pressure = 0.0;
    for (int c = 0; c < 4; ++c) {
        pressure += hat_[static_cast<std::size_t>(point)][c] * nodal[pressure_node_of_(c, element)];
    }
    return pressure;
}

double QuadraticTetrahedra::energy(const Matrix3Xd& u) const {
    const VectorXd J = jacobians(u);
    if (!(J.minCoeff() > 0.0)) return std::numeric_limits<double>::infinity();
    VectorXd part(tets_.cols());
    parallel_for(0, static_cast<int>(tets_.cols()), [&](int e) {
        const Material& material = material_[static_cast<std::size_t>(e)];
        part[e] = 0.0;
        for (int q = 0; q < points_; ++q) {
            const Matrix3d F = deformation_gradient(u, e, q);
            const double density =
                pressure_ == QuadraticPressure::Pointwise ? strain_energy(material, F) : shear_energy(material, F);
            part[e] += weight_[e * points_ + q] * density;
        }
    });
    double sum = part.sum();
    for (int a = 0; a < static_cast<int>(pressure_nodes_.size()); ++a) {
        const PressureNode& node = pressure_nodes_[static_cast<std::size_t>(a)];
        sum += node.volume * volumetric_modulus(node.material) *
               volumetric_function(node.material, nodal_jacobian(a, J)).energy;
    }
    return sum;
}

Matrix3Xd QuadraticTetrahedra::force(const Matrix3Xd& u) const {
    const VectorXd J = checked_jacobians(u), nodal = nodal_pressure(J);
    std::vector<Gradients> part(static_cast<std::size_t>(tets_.cols()));
    parallel_for(0, static_cast<int>(tets_.cols()), [&](int e) {
        Gradients& f = part[static_cast<std::size_t>(e)];
        f.setZero();
        for (int q = 0; q < points_; ++q) {
            const Matrix3d F = deformation_gradient(u, e, q);
            const int point = e * points_ + q;
            const Matrix3d P = shear_stress(material_[static_cast<std::size_t>(e)], F) +
                               pressure_at(e, q, J[point], nodal) * cofactor(F);
            f += weight_[point] * P * gradient_[static_cast<std::size_t>(point)];
        }
    });
    Matrix3Xd result = Matrix3Xd::Zero(3, node_count_);
    for (int e = 0; e < tets_.cols(); ++e) {
        for (int c = 0; c < 10; ++c) result.col(tets_(c, e)) += part[static_cast<std::size_t>(e)].col(c);
    }
    return result;
}

// ∫ ∇N · ∂P/∂F · ∇N at fixed averages of J.
QuadraticTetrahedra::ElementMatrix QuadraticTetrahedra::element_matrix(const Matrix3Xd& u, int element,
                                                                       const VectorXd& J, const VectorXd& nodal) const {
    const Material& material = material_[static_cast<std::size_t>(element)];
    ElementMatrix K = ElementMatrix::Zero();
    for (int q = 0; q < points_; ++q) {
        const int point = element * points_ + q;
        Tangent tangent = shear_tangent(material, deformation_gradient(u, element, q));
        const double stiffness = pressure_ == QuadraticPressure::Pointwise
                                     ? volumetric_modulus(material) * volumetric_function(material, J[point]).second
                                     : 0.0;
        add_volumetric_tangent(tangent, pressure_at(element, q, J[point], nodal), stiffness);
        Eigen::Matrix<double, 9, 30> G = Eigen::Matrix<double, 9, 30>::Zero();  // dF in column-major order of nodal du
        const Gradients& gradient = gradient_[static_cast<std::size_t>(point)];
        for (int c = 0; c < 10; ++c) {
            for (int j = 0; j < 3; ++j) {
                for (int i = 0; i < 3; ++i) G(3 * j + i, 3 * c + i) = gradient(j, c);
            }
        }
        const Eigen::Matrix<double, 9, 30> AG = weight_[point] * tangent.matrix() * G;
        K.noalias() += G.transpose() * AG;
    }
    return K;
}

// In chunks, so that the matrices of all elements need not be held at once; the sums always run in the same order.
void QuadraticTetrahedra::add_element_matrices(const Matrix3Xd& u, const VectorXd& J, const VectorXd& nodal,
                                               detail::BlockRows& rows) const {
    constexpr int chunk = 2048;
    const int count = static_cast<int>(tets_.cols());
    std::vector<ElementMatrix> matrices(static_cast<std::size_t>(std::min(chunk, count)));
    for (int begin = 0; begin < count; begin += chunk) {
        const int end = std::min(begin + chunk, count);
        parallel_for(begin, end,
                     [&](int e) { matrices[static_cast<std::size_t>(e - begin)] = element_matrix(u, e, J, nodal); });
        for (int e = begin; e < end; ++e) {
            for (int a = 0; a < 10; ++a) {
                const int i = tets_(a, e);
                const auto first = rows.column.begin() + rows.offset[static_cast<std::size_t>(i)],
                           last = rows.column.begin() + rows.offset[static_cast<std::size_t>(i) + 1];
                for (int b = 0; b < 10; ++b) {
                    const auto place = std::lower_bound(first, last, tets_(b, e)) - rows.column.begin();
                    rows.block[static_cast<std::size_t>(place)] +=
                        matrices[static_cast<std::size_t>(e - begin)].block<3, 3>(3 * a, 3 * b);
                }
            }
        }
    }
}

}  // namespace tissuewarp::tled
