#include "tled/stiffness/rest_stiffness.hpp"

#include <Eigen/Eigenvalues>

#include <cmath>
#include <functional>
#include <limits>
#include <mutex>
#include <string>

#include "core/errors.hpp"
#include "tled/blas_threads.hpp"
#include "tled/model/held_tissue.hpp"
#include "tled/model/springs.hpp"
#include "tled/parallel/parallel_pair.hpp"
#include "tled/stiffness/cholmod_factor.hpp"
#include "tled/stiffness/effect_stiffness.hpp"
#include "tled/stiffness/lowest_mode.hpp"
#include "tled/stiffness/smooth_space.hpp"
#include "tled/stiffness/stiffness.hpp"
#include "tled/stiffness/two_level.hpp"

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

/// What stiffnesses of one pattern share, made by the first that needs it.
struct Analysis {
    std::once_flag made;
    std::unique_ptr<const detail::CholmodFactor> factor;  // without numbers
};

/// What stiffnesses of one tissue and other springs share, made by the first that needs it.
struct Outline {
    std::vector<std::vector<int>> pieces;  // connected ones
    std::once_flag made;
    std::unique_ptr<const detail::SmoothSpace> space;

    explicit Outline(const RestState& rest) : pieces(detail::connected_pieces(rest)) {}
};

}  // namespace

struct RestStiffness::Impl {
    NodalConditions conditions;  // those factorised
    std::shared_ptr<const detail::Stiffness>
        elastic;  // K₀ with membranes and sliding pairs, without springs, all degrees of freedom
    std::shared_ptr<const std::vector<Matrix3d>> elastic_diagonal;  // of every node
    std::shared_ptr<Analysis> analysis = std::make_shared<Analysis>();
    std::shared_ptr<Outline> outline;
    Matrix3Xd position;      // at rest, mm
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
    [[nodiscard]] Matrix3Xd diagonal(const NodalConditions& present) const;
    [[nodiscard]] Matrix3Xd multiply(const Matrix3Xd& x, const NodalConditions& present) const {
        Matrix3Xd y = elastic->multiply(x);
        detail::add_spring_resistance(present, x, y);
        return y;
    }
    /// With the springs of `conditions`, zero where these constrain.
    [[nodiscard]] Matrix3Xd multiply_free(const Matrix3Xd& x) const {
        Matrix3Xd y = multiply(x, conditions);
        parallel_ranges(0, static_cast<std::size_t>(y.size()), 4096, [&](std::size_t begin, std::size_t end) {
            for (std::size_t d = begin; d < end; ++d)
                if (conditions.constrained.data()[d]) y.data()[d] = 0.0;
        });
        return y;
    }
    void require_held(const RestState& rest, const NodalConditions& present) const {
        detail::require_held(rest, outline->pieces, present);
    }
    void take(detail::Stiffness stiffness) {
        elastic_diagonal = std::make_shared<const std::vector<Matrix3d>>(stiffness.diagonal_blocks());
        elastic = std::make_shared<const detail::Stiffness>(std::move(stiffness));
    }
    void number_free(const NodalConditions& present);
    void factorise() const;
    [[nodiscard]] const detail::CholmodFactor& factor() const;
    [[nodiscard]] detail::BlockRows free_rows(const NodalConditions& springs) const;
    [[nodiscard]] const detail::SmoothSpace& smooth_space() const;
    [[nodiscard]] const detail::TwoLevel& two_levels() const;
    [[nodiscard]] Eigen::SparseMatrix<double> lower_triangle() const;
    void analyse(const std::function<Eigen::SparseMatrix<double>()>& lower) const;
    void require_compatible(const NodalConditions& present) const;
    [[nodiscard]] Matrix3Xd linear_force(const NodalConditions& present) const;
    template <class Preconditioner>
    [[nodiscard]] Matrix3Xd conjugate_gradients(const Matrix3Xd& force, const NodalConditions& present,
                                                const Preconditioner& precondition, double relative_tolerance) const;

    [[nodiscard]] double lowest_by_lanczos(const Matrix3Xd& diagonal) const;

    mutable std::once_flag divided;
    mutable std::unique_ptr<const detail::TwoLevel> levels;  // by two_levels()
    mutable std::once_flag factorised;
    mutable std::unique_ptr<detail::CholmodFactor> made;  // by factor()
    [[nodiscard]] const detail::Mode& slowest() const;

    std::once_flag lowest_known;
    double lowest = 0.0;
    Matrix3Xd slowest_about;  // where slowest() begins, if given
    mutable std::once_flag approximation_known;
    mutable detail::Mode approximation;  // by slowest()
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
// Force, answer and what the preconditioner makes of them are zero on the constrained degrees of freedom.
template <class Preconditioner>
Matrix3Xd RestStiffness::Impl::conjugate_gradients(const Matrix3Xd& force, const NodalConditions& present,
                                                   const Preconditioner& precondition,
                                                   double relative_tolerance) const {
    constexpr int max_iterations = 2000;
    const auto dot = [](const Matrix3Xd& a, const Matrix3Xd& b) { return a.cwiseProduct(b).sum(); };
    Matrix3Xd x = Matrix3Xd::Zero(3, force.cols()), r = force, z = precondition(r), p = z;
    double rz = dot(r, z);
    const double limit = relative_tolerance * relative_tolerance * rz;
    for (int iteration = 0; rz > limit; ++iteration) {
        const Matrix3Xd Kp = present.constrained.select(0.0, multiply(p, present));
        const double curvature = dot(p, Kp);
        if (iteration == max_iterations || !(curvature > 0.0)) {
            throw SolverFailure("conjugate gradients stopped at a relative residual of " +
                                std::to_string(relative_tolerance * std::sqrt(rz / limit)) + " after " +
                                std::to_string(iteration) +
                                " iterations: factorise the stiffness again with the present springs");
        }
        const double step = rz / curvature;
        x += step * p;
        r -= step * Kp;
        z = precondition(r);
        const double next = dot(r, z);
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
        VectorXd next = factor().solve(D.cwiseProduct(q));
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

/// Of `elastic` + springs on the free degrees of freedom.
Eigen::SparseMatrix<double> RestStiffness::Impl::lower_triangle() const {
    detail::BlockRows K = detail::assembled(*elastic, detail::Triangle::Lower);
    for (std::size_t s = 0; s < conditions.spring_node.size(); ++s)
        K.diagonal(conditions.spring_node[s]) += detail::spring_matrix(conditions, static_cast<int>(s));
    return detail::scalar_matrix(K, index, detail::Triangle::Lower);
}

void RestStiffness::Impl::analyse(const std::function<Eigen::SparseMatrix<double>()>& lower) const {
    std::call_once(analysis->made, [&] {
        std::vector<int> node_of;
        for (std::size_t d = 0; d < index.size(); ++d)
            if (index[d] >= 0) node_of.push_back(static_cast<int>(d) / 3);
        analysis->factor = std::make_unique<const detail::CholmodFactor>(lower(), node_of);
    });
}

void RestStiffness::Impl::factorise() const {
    const Eigen::SparseMatrix<double> lower = lower_triangle();
    analyse([&] { return lower; });
    auto numbers = std::make_unique<detail::CholmodFactor>(analysis->factor->analysis());
    if (!numbers->factorize(lower))
        throw InvalidInput(
            "the stiffness at rest is not positive definite: a node without tetrahedra, or tissue that the springs and "
            "prescribed displacements hold too weakly; hold it at more nodes or with stiffer springs");
    made = std::move(numbers);
}

/// Precondition: something is free.
const detail::CholmodFactor& RestStiffness::Impl::factor() const {
    std::call_once(factorised, [this] { factorise(); });
    return *made;
}

/// All rows of `elastic` + springs, zero where constrained.
detail::BlockRows RestStiffness::Impl::free_rows(const NodalConditions& springs) const {
    detail::BlockRows K = detail::assembled(*elastic, detail::Triangle::Full);
    for (std::size_t s = 0; s < springs.spring_node.size(); ++s)
        K.diagonal(springs.spring_node[s]) += detail::spring_matrix(springs, static_cast<int>(s));
    for (int i = 0; i < K.rows(); ++i)
        for (int k = K.offset[i]; k < K.offset[i + 1]; ++k)
            for (int c = 0; c < 3; ++c) {
                if (conditions.constrained(c, i)) K.block[k].row(c).setZero();
                if (conditions.constrained(c, K.column[k])) K.block[k].col(c).setZero();
            }
    return K;
}

const detail::TwoLevel& RestStiffness::Impl::two_levels() const {
    std::call_once(divided, [this] {
        const auto product = [this](const Matrix3Xd& x) { return multiply_free(x); };
        levels =
            std::make_unique<const detail::TwoLevel>(free_rows(conditions), product, position, conditions.constrained);
    });
    return *levels;
}

const detail::SmoothSpace& RestStiffness::Impl::smooth_space() const {
    std::call_once(outline->made, [this] {
        outline->space = std::make_unique<const detail::SmoothSpace>(free_rows({}), position, conditions.constrained);
    });
    return *outline->space;
}

Matrix3Xd RestStiffness::Impl::diagonal(const NodalConditions& present) const {
    Matrix3Xd result(3, static_cast<Eigen::Index>(elastic_diagonal->size()));
    for (std::size_t i = 0; i < elastic_diagonal->size(); ++i) result.col(i) = (*elastic_diagonal)[i].diagonal();
    for (std::size_t s = 0; s < present.spring_node.size(); ++s)
        result.col(present.spring_node[s]) += present.spring_stiffness.col(s).head<3>();
    return present.constrained.select(Matrix3Xd::Ones(3, result.cols()), result);
}

/// Precondition: something is free.
const detail::Mode& RestStiffness::Impl::slowest() const {
    const auto product = [this](const Matrix3Xd& x) { return multiply_free(x); };
    constexpr detail::Patience of_given{2, 0.05};  // relaxation, which asks for it, makes up for more in fewer products
    std::call_once(approximation_known, [&] {
        const Matrix3Xd D = diagonal(conditions);
        const bool given = slowest_about.size() > 0 && !slowest_about.isZero(0);
        approximation = given ? detail::lowest_mode(product, D, slowest_about, of_given)
                              : detail::lowest_mode(product, D, smooth_space().slowest(conditions, D));
    });
    return approximation;
}

RestStiffness::RestStiffness(const RestState& rest, const NodalConditions& conditions)
    : impl_(std::make_unique<Impl>()) {
    impl_->outline = std::make_shared<Outline>(rest);
    impl_->require_held(rest, conditions);
    detail::Stiffness elastic = detail::stiffness(rest, Matrix3Xd::Zero(3, rest.node_count));
    detail::add_effects(conditions.effects.surface, rest.position, elastic);
    impl_->take(std::move(elastic));
    impl_->position = rest.position;
    impl_->number_free(conditions);
}

RestStiffness::RestStiffness(const RestState& rest, const NodalConditions& conditions, const Matrix3Xd& displacement)
    : impl_(std::make_unique<Impl>()) {
    impl_->outline = std::make_shared<Outline>(rest);
    impl_->require_held(rest, conditions);
    detail::Stiffness metric = detail::stiffness(rest, displacement);
    metric.elements = detail::stiffness(rest, Matrix3Xd::Zero(3, rest.node_count)).elements;
    metric.products.stiffness = metric.products.stiffness.cwiseMax(0.0);
    detail::add_effects(conditions.effects.surface, rest.position, metric);
    impl_->take(std::move(metric));
    impl_->position = rest.position;
    impl_->number_free(conditions);
}

RestStiffness::RestStiffness(const RestState& rest, const NodalConditions& conditions, const RestStiffness& other)
    : impl_(std::make_unique<Impl>()) {
    other.impl_->require_held(rest, conditions);
    other.impl_->require_compatible(conditions);
    impl_->elastic = other.impl_->elastic;
    impl_->elastic_diagonal = other.impl_->elastic_diagonal;
    impl_->analysis = other.impl_->analysis;
    impl_->outline = other.impl_->outline;
    impl_->position = rest.position;
    impl_->number_free(conditions);
}

RestStiffness::RestStiffness(const RestState& rest, const NodalConditions& conditions, const RestStiffness& other,
                             const Matrix3Xd& slowest_about)
    : RestStiffness(rest, conditions, other) {
    impl_->slowest_about = conditions.constrained.select(0.0, slowest_about);
}

RestStiffness::~RestStiffness() = default;
RestStiffness::RestStiffness(RestStiffness&&) noexcept = default;
RestStiffness& RestStiffness::operator=(RestStiffness&&) noexcept = default;

void RestStiffness::analyse() const {
    if (impl_->free_count > 0) impl_->analyse([this] { return impl_->lower_triangle(); });
}

void RestStiffness::factorise() const {
    if (impl_->free_count > 0) static_cast<void>(impl_->factor());
}

void factorise_together(const RestStiffness& first, const RestStiffness& second) {
    first.analyse();
    const detail::SingleBlasThread single;
    parallel_pair([&] { first.factorise(); }, [&] { second.factorise(); });
}

Matrix3Xd RestStiffness::solve(const Matrix3Xd& force) const {
    if (impl_->free_count == 0) return Matrix3Xd::Zero(3, force.cols());
    return impl_->expanded(impl_->factor().solve(impl_->reduced(force)));
}

Matrix3Xd RestStiffness::solve(const Matrix3Xd& force, const NodalConditions& conditions,
                               double relative_tolerance) const {
    impl_->require_compatible(conditions);
    if (same_springs(conditions, impl_->conditions) || impl_->free_count == 0) return solve(force);
    const auto precondition = [this](const Matrix3Xd& r) { return solve(r); };
    return impl_->conjugate_gradients(conditions.constrained.select(0.0, force), conditions, precondition,
                                      relative_tolerance);
}

MatrixXd RestStiffness::solve_columns(const MatrixXd& forces) const {
    return impl_->on_free(forces, [&](const MatrixXd& free) { return impl_->factor().solve_columns(free); });
}

bool RestStiffness::is_large() const {
    return impl_->position.cols() > most_factorised_nodes;
}

Matrix3Xd RestStiffness::precondition(const Matrix3Xd& force) const {
    if (!is_large() || impl_->free_count == 0) return solve(force);
    return impl_->two_levels().cycle(impl_->conditions.constrained.select(0.0, force));
}

Matrix3Xd RestStiffness::solve_iteratively(const Matrix3Xd& force, const NodalConditions& conditions,
                                           double relative_tolerance) const {
    if (!is_large() || impl_->free_count == 0) return solve(force, conditions, relative_tolerance);
    impl_->require_compatible(conditions);
    const auto about = [this](const Matrix3Xd& r) { return precondition(r); };
    return impl_->conjugate_gradients(conditions.constrained.select(0.0, force), conditions, about, relative_tolerance);
}

// K_ff u_f = f_f + springs' targets − K_fc u_c: the imposed values enter with the residual of u = (0, u_c).
Matrix3Xd RestStiffness::Impl::linear_force(const NodalConditions& present) const {
    return detail::applied_force(present) - multiply(present.imposed, present);
}

Matrix3Xd RestStiffness::linear_solution(const NodalConditions& conditions) const {
    constexpr double tolerance = 1e-10;
    return conditions.imposed + solve(impl_->linear_force(conditions), conditions, tolerance);
}

Matrix3Xd RestStiffness::linear_solution(const NodalConditions& conditions, double relative_tolerance) const {
    return conditions.imposed + solve_iteratively(impl_->linear_force(conditions), conditions, relative_tolerance);
}

Matrix3Xd RestStiffness::elastic_resistance(const Matrix3Xd& displacement) const {
    return impl_->elastic->multiply(displacement);
}

Matrix3Xd RestStiffness::diagonal(const NodalConditions& conditions) const {
    impl_->require_compatible(conditions);
    return impl_->diagonal(conditions);
}

double RestStiffness::lowest_eigenvalue() const {
    if (impl_->free_count == 0) return std::numeric_limits<double>::infinity();
    std::call_once(impl_->lowest_known,
                   [this] { impl_->lowest = impl_->lowest_by_lanczos(diagonal(impl_->conditions)); });
    return impl_->lowest;
}

double RestStiffness::approximate_lowest_eigenvalue() const {
    return impl_->free_count > 0 ? impl_->slowest().value : std::numeric_limits<double>::infinity();
}

const Matrix3Xd& RestStiffness::approximate_slowest_mode() const {
    return impl_->slowest().x;
}

long long RestStiffness::factor_nonzeros() const {
    return impl_->free_count > 0 ? impl_->factor().nonzeros() : 0;
}

}  // namespace tissuewarp::tled
