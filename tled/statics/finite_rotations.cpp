#include "tled/statics/finite_rotations.hpp"

#include "core/errors.hpp"
#include "tled/model/kinematics.hpp"
#include "tled/parallel/parallel.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <atomic>
#include <numeric>
#include <utility>
#include <vector>

namespace tissuewarp::tled::detail {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;

namespace {

/// Σ w ∇N_a · ∇N_b, both triangles.
Eigen::SparseMatrix<double> laplacian(const RestState& rest, const Eigen::VectorXd& weight) {
    std::vector<Eigen::Triplet<double>> entries;
    entries.reserve(16 * static_cast<std::size_t>(rest.element_count()));
    for (int e = 0; e < rest.element_count(); ++e) {
        const Eigen::Matrix<double, 3, 4> gradient = shape_gradients(rest, e);
        for (int a = 0; a < 4; ++a)
            for (int b = 0; b < 4; ++b)
                entries.emplace_back(rest.nodes(a, e), rest.nodes(b, e),
                                     weight[e] * gradient.col(a).dot(gradient.col(b)));
    }
    Eigen::SparseMatrix<double> matrix(rest.node_count, rest.node_count);
    matrix.setFromTriplets(entries.begin(), entries.end());
    return matrix;
}

/// Its lower triangle on the free nodes. Every node is attached a little to where it is, which places tissue that
/// nothing holds.
Eigen::SparseMatrix<double> attached(const Eigen::SparseMatrix<double>& laplacian, const std::vector<int>& free) {
    constexpr double attachment = 1e-9;  // of the diagonal
    std::vector<int> number(static_cast<std::size_t>(laplacian.rows()), -1);
    for (std::size_t f = 0; f < free.size(); ++f) number[static_cast<std::size_t>(free[f])] = static_cast<int>(f);
    std::vector<Eigen::Triplet<double>> entries;
    for (const int node : free)
        for (Eigen::SparseMatrix<double>::InnerIterator it(laplacian, node); it; ++it) {
            const int row = number[static_cast<std::size_t>(it.row())], column = number[static_cast<std::size_t>(node)];
            if (row < column) continue;
            entries.emplace_back(row, column, row == column ? (1 + attachment) * it.value() : it.value());
        }
    Eigen::SparseMatrix<double> lower(static_cast<int>(free.size()), static_cast<int>(free.size()));
    lower.setFromTriplets(entries.begin(), entries.end());
    return lower;
}

/// exp(ω) (1 + ε) of the increment's gradient in space.
Matrix3d turned(const Matrix3d& gradient) {
    const Matrix3d spin = 0.5 * (gradient - gradient.transpose()), strain = 0.5 * (gradient + gradient.transpose());
    const Vector3d axis(spin(2, 1), spin(0, 2), spin(1, 0));
    const double angle = axis.norm();
    const Matrix3d stretch = Matrix3d::Identity() + strain;
    return angle > 0 ? Matrix3d(Eigen::AngleAxisd(angle, axis / angle).toRotationMatrix() * stretch) : stretch;
}

/// The nearest F whose principal stretches are `least` or more.
Matrix3d stretched(const Matrix3d& F, double least) {
    const Eigen::SelfAdjointEigenSolver<Matrix3d> C(F.transpose() * F);
    Matrix3d from = C.eigenvectors(), to;
    from.col(0) = from.col(1).cross(from.col(2));
    to.col(2) = (F * from.col(2)).normalized();
    const Vector3d second = F * from.col(1);
    to.col(1) = second.norm() > 0 ? Vector3d(second.normalized()) : Vector3d(to.col(2).unitOrthogonal());
    to.col(0) = to.col(1).cross(to.col(2));
    const Vector3d stretch = (to.transpose() * F * from).diagonal();
    return to * stretch.cwiseMax(least).asDiagonal() * from.transpose();
}

}  // namespace

FiniteRotations::FiniteRotations(const RestState& rest, const NodalConditions& conditions)
    : rest_(rest), weight_(rest.element_count()) {
    const std::vector<int> material_of = material_of_elements(rest);
    for (int e = 0; e < rest.element_count(); ++e)
        weight_[e] = rest.volume[e] * shear_modulus(rest.materials[static_cast<std::size_t>(material_of[e])]);
    laplacian_ = laplacian(rest, weight_);
    for (int axis = 0; axis < 3; ++axis) {
        Axis& each = axes_[static_cast<std::size_t>(axis)];
        for (int n = 0; n < rest.node_count; ++n)
            if (!conditions.constrained(axis, n)) each.free.push_back(n);
        if (each.free.empty()) continue;
        const Eigen::SparseMatrix<double> lower = attached(laplacian_, each.free);
        std::vector<int> numbers(each.free.size());
        std::iota(numbers.begin(), numbers.end(), 0);
        each.factor = std::make_unique<CholmodFactor>(lower, numbers);
        if (!each.factor->factorize(lower)) throw SolverFailure("the Laplacian of the mesh is not positive definite");
    }
}

Matrix3Xd FiniteRotations::moved(const Matrix3Xd& displacement, const Matrix3Xd& increment) const {
    std::vector<Matrix3d> goal(static_cast<std::size_t>(rest_.element_count()));
    parallel_for(0, rest_.element_count(), [&](int e) {
        const Matrix3d F = deformation_gradient(rest_, displacement, e);
        const Matrix3d change = deformation_gradient(rest_, increment, e) - Matrix3d::Identity();
        goal[static_cast<std::size_t>(e)] = turned(change * F.inverse()) * F;
    });
    return fitted(displacement + increment, goal);
}

Matrix3Xd FiniteRotations::like(const Matrix3Xd& other, const NodalConditions& imposed) const {
    constexpr int most_rounds = 50;
    constexpr double least_stretch = 0.3, least_jacobian = 0.02;
    std::vector<Matrix3d> goal(static_cast<std::size_t>(rest_.element_count())), push(goal.size(), Matrix3d::Zero());
    const auto set_goals = [&](const Matrix3Xd& displacement) {
        std::atomic<int> mended = 0;
        parallel_for(0, rest_.element_count(), [&](int e) {
            const auto each = static_cast<std::size_t>(e);
            goal[each] = deformation_gradient(rest_, displacement, e);
            if (goal[each].determinant() >= least_jacobian) return;
            ++mended;
            push[each] += stretched(goal[each], least_stretch) - goal[each];  // small ones among large ones gain weight
            goal[each] += push[each];
        });
        return mended.load();
    };
    set_goals(other);
    Matrix3Xd result = fitted(imposed.constrained.select(imposed.imposed, other), goal);
    for (int round = 0; round < most_rounds && set_goals(result) > 0; ++round) result = fitted(std::move(result), goal);
    return result;
}

Matrix3Xd FiniteRotations::fitted(Matrix3Xd moved, const std::vector<Matrix3d>& goal) const {
    Matrix3Xd pull = Matrix3Xd::Zero(3, rest_.node_count);
    for (int e = 0; e < rest_.element_count(); ++e)
        for (int a = 0; a < 4; ++a)
            pull.col(rest_.nodes(a, e)) +=
                weight_[e] * (goal[static_cast<std::size_t>(e)] * shape_gradients(rest_, e).col(a));
    const Matrix3Xd missing = pull - (rest_.position + moved) * laplacian_;
    for (int axis = 0; axis < 3; ++axis) {
        const Axis& each = axes_[static_cast<std::size_t>(axis)];
        if (each.free.empty()) continue;
        const Eigen::VectorXd right = missing(axis, each.free).transpose();
        moved(axis, each.free) += each.factor->solve(right).transpose();
    }
    return moved;
}

}  // namespace tissuewarp::tled::detail
