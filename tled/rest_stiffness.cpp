#include "tled/rest_stiffness.hpp"

#include <Eigen/Eigenvalues>

#include <cmath>
#include <limits>
#include <mutex>
#include <string>

#include "core/errors.hpp"
#include "tled/detail/cholmod_factor.hpp"
#include "tled/detail/effect_stiffness.hpp"
#include "tled/detail/held_tissue.hpp"
#include "tled/detail/springs.hpp"
#include "tled/detail/stiffness.hpp"

namespace tissuewarp::tled {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

bool same_springs(const NodalConditions& a, const NodalConditions& b) {
    return a.spring_node == b.spring_node && a.spring_stiffness.cols() == b.spring_stiffness.cols() &&
           a.spring_stiffness == b.spring_stiffness;
}

}  // namespace

struct RestStiffness::Impl {
    NodalConditions conditions;  // those factorised
    std::shared_ptr<const detail::Stiffness>
        elastic;  // K₀ with membranes and sliding pairs, without springs, all degrees of freedom
    std::unique_ptr<detail::CholmodFactor> factor;
    std::vector<int> index;  // degree of freedom 3·node + component → free number or −1
    int free_count = 0;

    [[nodiscard]] VectorXd reduced(const Matrix3Xd& x) const {
        VectorXd result(free_count);
        for (std::size_t d = 0; d < index.size(); ++d) {
            if (index[d] >= 0) result[index[d]] = x.data()[d];
        }
        return result;
    }
    [[nodiscard]] Matrix3Xd expanded(const VectorXd& x) const {
        Matrix3Xd result = Matrix3Xd::Zero(3, static_cast<Eigen::Index>(index.size()) / 3);
        for (std::size_t d = 0; d < index.size(); ++d) {
            if (index[d] >= 0) result.data()[d] = x[index[d]];
        }
        return result;
    }
    /// `operation` on the free rows of columns (3N × k); zero elsewhere.
    template <class Operation>
    [[nodiscard]] MatrixXd on_free(const MatrixXd& columns, const Operation& operation) const {
        MatrixXd free(free_count, columns.cols()), result = MatrixXd::Zero(columns.rows(), columns.cols());
        if (free_count == 0) return result;
        for (std::size_t d = 0; d < index.size(); ++d)
            if (index[d] >= 0) free.row(index[d]) = columns.row(static_cast<Eigen::Index>(d));
        const MatrixXd answer = operation(free);
        for (std::size_t d = 0; d < index.size(); ++d)
            if (index[d] >= 0) result.row(static_cast<Eigen::Index>(d)) = answer.row(index[d]);
        return result;
    }
    [[nodiscard]] Matrix3Xd multiply(const Matrix3Xd& x, const NodalConditions& present) const {
        Matrix3Xd y = elastic->multiply(x);
        detail::add_spring_resistance(present, x, y);
        return y;
    }
    void number_free(const NodalConditions& present);
    void factorise(const detail::CholmodFactor* analysed);
    void require_compatible(const NodalConditions& present) const;
    [[nodiscard]] VectorXd conjugate_gradients(const VectorXd& force, const NodalConditions& present,
                                               double relative_tolerance) const;

    [[nodiscard]] double lowest_by_lanczos(const Matrix3Xd& diagonal) const;

    std::once_flag lowest_known;
    double lowest = 0.0;
};

void RestStiffness::Impl::require_compatible(const NodalConditions& present) const {
    if (present.constrained.cols() != conditions.constrained.cols() ||
        (present.constrained.array() != conditions.constrained.array()).any()) {
        throw InvalidInput(
            "the prescribed degrees of freedom differ from those of the factorised stiffness: construct another "
            "RestStiffness for them");
    }
}

// Preconditioned conjugate gradients (Saad, Iterative Methods for Sparse Linear Systems, algorithm 9.1). The error is
// measured in the norm of the preconditioner, √(r·z), relative to its start.
VectorXd RestStiffness::Impl::conjugate_gradients(const VectorXd& force, const NodalConditions& present,
                                                  double relative_tolerance) const {
    constexpr int max_iterations = 2000;
    VectorXd x = VectorXd::Zero(free_count), r = force, z = factor->solve(r), p = z;
    double rz = r.dot(z);
    const double limit = relative_tolerance * relative_tolerance * rz;
    for (int iteration = 0; rz > limit; ++iteration) {
        const VectorXd Kp = reduced(multiply(expanded(p), present));
        const double curvature = p.dot(Kp);
        if (iteration == max_iterations || !(curvature > 0.0)) {
            throw SolverFailure("conjugate gradients stopped at a relative residual of " +
                                std::to_string(relative_tolerance * std::sqrt(rz / limit)) + " after " +
                                std::to_string(iteration) +
                                " iterations: factorise the stiffness again with the present springs");
        }
        const double step = rz / curvature;
        x += step * p;
        r -= step * Kp;
        z = factor->solve(r);
        const double next = r.dot(z);
        p = z + next / rz * p;
        rz = next;
    }
    return x;
}

// Smallest λ of K x = λ D x for the diagonal D: Lanczos steps on K⁻¹ D, symmetric in the inner product of D, from a
// fixed vector without symmetry (Parlett, The Symmetric Eigenvalue Problem (1998), section 13.2), with all directions
// made orthogonal again. The largest Ritz value errs by the square of its vector's error.
double RestStiffness::Impl::lowest_by_lanczos(const Matrix3Xd& diagonal) const {
    constexpr int most_steps = 20;
    constexpr double tolerance = 1e-4;  // damping presets and frequencies, its users, follow √λ
    const VectorXd D = reduced(diagonal);
    VectorXd q(free_count);
    for (int i = 0; i < q.size(); ++i) q[i] = 1.0 + 0.5 * std::sin(0.7 * i);
    q /= std::sqrt(q.dot(D.cwiseProduct(q)));
    std::vector<VectorXd> basis;
    MatrixXd projected = MatrixXd::Zero(most_steps + 1, most_steps + 1);  // of K⁻¹ D, tridiagonal
    double largest = 0.0;
    for (int step = 0; step < most_steps; ++step) {
        basis.push_back(q);
        VectorXd next = factor->solve(D.cwiseProduct(q));
        projected(step, step) = next.dot(D.cwiseProduct(q));
        for (int pass = 0; pass < 2; ++pass)
            for (const VectorXd& other : basis) next -= next.dot(D.cwiseProduct(other)) * other;
        const double length = std::sqrt(next.dot(D.cwiseProduct(next)));
        const Eigen::SelfAdjointEigenSolver<MatrixXd> ritz(projected.topLeftCorner(step + 1, step + 1));
        const double before = largest;
        largest = ritz.eigenvalues()[step];
        const double remainder = length * std::abs(ritz.eigenvectors()(step, step));
        const bool settled = remainder <= std::sqrt(tolerance) * largest && largest - before <= tolerance * largest;
        if (settled || remainder <= tolerance * largest) break;  // none remains once all directions are spanned
        projected(step + 1, step) = projected(step, step + 1) = length;
        q = next / length;
    }
    return 1.0 / largest;
}

void RestStiffness::Impl::number_free(const NodalConditions& present) {
    conditions = present;
    index.assign(static_cast<std::size_t>(present.constrained.size()), -1);
    for (int d = 0; d < static_cast<int>(index.size()); ++d)
        if (!present.constrained.data()[d]) index[static_cast<std::size_t>(d)] = free_count++;
}

// Factor of `elastic` + springs on the free degrees of freedom; with the analysis of `analysed`, where there is one.
void RestStiffness::Impl::factorise(const detail::CholmodFactor* analysed) {
    if (free_count == 0) return;
    detail::BlockRows K = detail::assembled(*elastic, detail::Triangle::Lower);
    for (std::size_t s = 0; s < conditions.spring_node.size(); ++s)
        K.diagonal(conditions.spring_node[s]) += detail::spring_matrix(conditions, static_cast<int>(s));
    const Eigen::SparseMatrix<double> lower = detail::scalar_matrix(K, index, detail::Triangle::Lower);
    K = {};
    if (analysed != nullptr) {
        factor = std::make_unique<detail::CholmodFactor>(analysed->analysis());
    } else {
        std::vector<int> node_of;
        for (std::size_t d = 0; d < index.size(); ++d)
            if (index[d] >= 0) node_of.push_back(static_cast<int>(d) / 3);
        factor = std::make_unique<detail::CholmodFactor>(lower, node_of);
    }
    if (factor->factorize(lower)) return;
    throw InvalidInput(
        "the stiffness at rest is not positive definite: a node without tetrahedra, or tissue that the springs and "
        "prescribed displacements hold too weakly; hold it at more nodes or with stiffer springs");
}

RestStiffness::RestStiffness(const RestState& rest, const NodalConditions& conditions)
    : impl_(std::make_unique<Impl>()) {
    detail::require_held(rest, conditions);
    detail::Stiffness elastic = detail::stiffness(rest, Matrix3Xd::Zero(3, rest.node_count));
    detail::add_effects(conditions.effects.surface, rest.position, elastic);
    impl_->elastic = std::make_shared<detail::Stiffness>(std::move(elastic));
    impl_->number_free(conditions);
    impl_->factorise(nullptr);
}

RestStiffness::RestStiffness(const RestState& rest, const NodalConditions& conditions, const Matrix3Xd& displacement)
    : impl_(std::make_unique<Impl>()) {
    detail::require_held(rest, conditions);
    detail::Stiffness metric = detail::stiffness(rest, displacement);
    metric.elements = detail::stiffness(rest, Matrix3Xd::Zero(3, rest.node_count)).elements;
    metric.products.stiffness = metric.products.stiffness.cwiseMax(0.0);
    detail::add_effects(conditions.effects.surface, rest.position, metric);
    impl_->elastic = std::make_shared<detail::Stiffness>(std::move(metric));
    impl_->number_free(conditions);
    impl_->factorise(nullptr);
}

RestStiffness::RestStiffness(const RestState& rest, const NodalConditions& conditions, const RestStiffness& other)
    : impl_(std::make_unique<Impl>()) {
    detail::require_held(rest, conditions);
    other.impl_->require_compatible(conditions);
    impl_->elastic = other.impl_->elastic;
    impl_->number_free(conditions);
    impl_->factorise(other.impl_->factor.get());
}

RestStiffness::~RestStiffness() = default;
RestStiffness::RestStiffness(RestStiffness&&) noexcept = default;
RestStiffness& RestStiffness::operator=(RestStiffness&&) noexcept = default;

Matrix3Xd RestStiffness::solve(const Matrix3Xd& force) const {
    if (impl_->free_count == 0) return Matrix3Xd::Zero(3, force.cols());
    return impl_->expanded(impl_->factor->solve(impl_->reduced(force)));
}

Matrix3Xd RestStiffness::solve(const Matrix3Xd& force, const NodalConditions& conditions,
                               double relative_tolerance) const {
    impl_->require_compatible(conditions);
    if (same_springs(conditions, impl_->conditions) || impl_->free_count == 0) return solve(force);
    return impl_->expanded(impl_->conjugate_gradients(impl_->reduced(force), conditions, relative_tolerance));
}

MatrixXd RestStiffness::solve_columns(const MatrixXd& forces) const {
    return impl_->on_free(forces, [&](const MatrixXd& free) { return impl_->factor->solve_columns(free); });
}

MatrixXd RestStiffness::colour_columns(const MatrixXd& white) const {
    return impl_->on_free(white, [&](const MatrixXd& free) { return impl_->factor->colour_columns(free); });
}

Matrix3Xd RestStiffness::linear_solution(const NodalConditions& conditions) const {
    // K_ff u_f = f_f + springs' targets − K_fc u_c: the imposed values enter with the residual of u = (0, u_c).
    constexpr double tolerance = 1e-10;
    const Matrix3Xd force = detail::applied_force(conditions) - impl_->multiply(conditions.imposed, conditions);
    return conditions.imposed + solve(force, conditions, tolerance);
}

Matrix3Xd RestStiffness::diagonal(const NodalConditions& conditions) const {
    impl_->require_compatible(conditions);
    std::vector<Matrix3d> blocks = impl_->elastic->diagonal_blocks();
    for (std::size_t s = 0; s < conditions.spring_node.size(); ++s) {
        blocks[conditions.spring_node[s]] += detail::spring_matrix(conditions, static_cast<int>(s));
    }
    Matrix3Xd result(3, static_cast<Eigen::Index>(blocks.size()));
    for (std::size_t i = 0; i < blocks.size(); ++i) result.col(i) = blocks[i].diagonal();
    return conditions.constrained.select(Matrix3Xd::Ones(3, result.cols()), result);
}

double RestStiffness::lowest_eigenvalue() const {
    if (impl_->free_count == 0) return std::numeric_limits<double>::infinity();
    std::call_once(impl_->lowest_known,
                   [this] { impl_->lowest = impl_->lowest_by_lanczos(diagonal(impl_->conditions)); });
    return impl_->lowest;
}

long long RestStiffness::factor_nonzeros() const {
    return impl_->factor ? impl_->factor->nonzeros() : 0;
}

}  // namespace tissuewarp::tled
