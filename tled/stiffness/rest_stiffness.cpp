#include "tled/stiffness/rest_stiffness.hpp"

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
#include "tled/stiffness/chebyshev.hpp"
#include "tled/stiffness/cholmod_factor.hpp"
#include "tled/stiffness/conjugate_gradients.hpp"
#include "tled/stiffness/effect_stiffness.hpp"
#include "tled/stiffness/free_degrees.hpp"
#include "tled/stiffness/lanczos.hpp"
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
    Matrix3Xd position;  // at rest, mm
    detail::FreeDegrees free;

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
    void take(const NodalConditions& present) {
        conditions = present;
        free = detail::FreeDegrees(present.constrained);
    }
    [[nodiscard]] bool factorises() const;
    void factorise() const;
    [[nodiscard]] const detail::CholmodFactor& factor() const;
    [[nodiscard]] detail::BlockRows free_rows(const NodalConditions& springs) const;
    [[nodiscard]] const detail::SmoothSpace& smooth_space() const;
    [[nodiscard]] const detail::TwoLevel& two_levels() const;
    [[nodiscard]] Eigen::SparseMatrix<double> lower_triangle() const;
    void analyse(const std::function<Eigen::SparseMatrix<double>()>& lower) const;
    void require_compatible(const NodalConditions& present) const;
    [[nodiscard]] Matrix3Xd linear_force(const NodalConditions& present) const;
    [[nodiscard]] Matrix3Xd iterated(const Matrix3Xd& force, const NodalConditions& present,
                                     const detail::Product& precondition, double relative_tolerance) const;
    [[nodiscard]] const detail::Mode& slowest() const;

    mutable std::once_flag divided;
    mutable std::unique_ptr<const detail::TwoLevel> levels;  // by two_levels()
    mutable std::once_flag factorised;
    mutable std::unique_ptr<detail::CholmodFactor> made;  // by factor()
    std::once_flag lowest_known;
    double lowest = 0.0;
    std::once_flag highest_known;
    double highest = 0.0;
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

/// Force and answer are zero on the constrained degrees of freedom.
Matrix3Xd RestStiffness::Impl::iterated(const Matrix3Xd& force, const NodalConditions& present,
                                        const detail::Product& precondition, double relative_tolerance) const {
    const auto product = [&](const Matrix3Xd& x) -> Matrix3Xd {
        return present.constrained.select(0.0, multiply(x, present));
    };
    return detail::conjugate_gradients(product, precondition, present.constrained.select(0.0, force),
                                       relative_tolerance);
}

/// Of `elastic` + springs on the free degrees of freedom.
Eigen::SparseMatrix<double> RestStiffness::Impl::lower_triangle() const {
    detail::BlockRows K = detail::assembled(*elastic, detail::Triangle::Lower);
    for (std::size_t s = 0; s < conditions.spring_node.size(); ++s)
        K.diagonal(conditions.spring_node[s]) += detail::spring_matrix(conditions, static_cast<int>(s));
    return detail::scalar_matrix(K, free.index(), detail::Triangle::Lower);
}

void RestStiffness::Impl::analyse(const std::function<Eigen::SparseMatrix<double>()>& lower) const {
    std::call_once(analysis->made,
                   [&] { analysis->factor = std::make_unique<const detail::CholmodFactor>(lower(), free.nodes()); });
}

/// Makes the factor; false where the stiffness is not positive definite.
bool RestStiffness::Impl::factorises() const {
    const Eigen::SparseMatrix<double> lower = lower_triangle();
    analyse([&] { return lower; });
    auto numbers = std::make_unique<detail::CholmodFactor>(analysis->factor->analysis());
    if (!numbers->factorize(lower)) return false;
    made = std::move(numbers);
    return true;
}

void RestStiffness::Impl::factorise() const {
    if (made == nullptr && !factorises())
        throw InvalidInput(
            "the stiffness at rest is not positive definite: a node without tetrahedra, or tissue that the springs and "
            "prescribed displacements hold too weakly (hold it at more nodes or with stiffer springs)");
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
            std::make_unique<const detail::TwoLevel>(free_rows(conditions), product, position, conditions.constrained,
                                                     detail::TwoLevel::suggested_cells(position.cols()));
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
    impl_->take(conditions);
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
    impl_->take(conditions);
    if (impl_->free.count() > 0 && !impl_->factorises())
        throw SolverFailure("the stiffness of a far state cannot be factorised: apply the load in parts");
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
    impl_->take(conditions);
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
    if (impl_->free.count() > 0) impl_->analyse([this] { return impl_->lower_triangle(); });
}

void RestStiffness::factorise() const {
    if (impl_->free.count() > 0) static_cast<void>(impl_->factor());
}

void factorise_together(const RestStiffness& first, const RestStiffness& second) {
    first.analyse();
    const detail::SingleBlasThread single;
    parallel_pair([&] { first.factorise(); }, [&] { second.factorise(); });
}

Matrix3Xd RestStiffness::solve(const Matrix3Xd& force) const {
    if (impl_->free.count() == 0) return Matrix3Xd::Zero(3, force.cols());
    return impl_->free.expanded(impl_->factor().solve(impl_->free.reduced(force)));
}

Matrix3Xd RestStiffness::solve(const Matrix3Xd& force, const NodalConditions& conditions,
                               double relative_tolerance) const {
    impl_->require_compatible(conditions);
    if (same_springs(conditions, impl_->conditions) || impl_->free.count() == 0) return solve(force);
    const auto precondition = [this](const Matrix3Xd& r) { return solve(r); };
    return impl_->iterated(force, conditions, precondition, relative_tolerance);
}

MatrixXd RestStiffness::solve_columns(const MatrixXd& forces) const {
    return impl_->free.on_free(forces, [&](const MatrixXd& free) { return impl_->factor().solve_columns(free); });
}

MatrixXd RestStiffness::inverse_between(const std::vector<int>& nodes) const {
    std::vector<int> unknowns;
    std::vector<Eigen::Index> place;  // of each, among the degrees of freedom of `nodes`
    for (std::size_t n = 0; n < nodes.size(); ++n)
        for (std::size_t c = 0; c < 3; ++c) {
            const int unknown = impl_->free.index()[3 * static_cast<std::size_t>(nodes[n]) + c];
            if (unknown < 0) continue;
            unknowns.push_back(unknown);
            place.push_back(static_cast<Eigen::Index>(3 * n + c));
        }
    const auto count = static_cast<Eigen::Index>(3 * nodes.size());
    MatrixXd result = MatrixXd::Zero(count, count);
    if (!unknowns.empty()) result(place, place) = impl_->factor().inverse_between(unknowns);
    return result;
}

bool RestStiffness::is_large() const {
    return impl_->position.cols() > most_factorised_nodes;
}

Matrix3Xd RestStiffness::precondition(const Matrix3Xd& force) const {
    if (!is_large() || impl_->free.count() == 0) return solve(force);
    return impl_->two_levels().cycle(impl_->conditions.constrained.select(0.0, force));
}

Matrix3Xd RestStiffness::solve_iteratively(const Matrix3Xd& force, const NodalConditions& conditions,
                                           double relative_tolerance) const {
    if (!is_large() || impl_->free.count() == 0) return solve(force, conditions, relative_tolerance);
    impl_->require_compatible(conditions);
    const auto about = [this](const Matrix3Xd& r) { return precondition(r); };
    return impl_->iterated(force, conditions, about, relative_tolerance);
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
    if (impl_->free.count() == 0) return std::numeric_limits<double>::infinity();
    std::call_once(impl_->lowest_known, [this] {
        const auto solve = [this](const VectorXd& b) { return impl_->factor().solve(b); };
        impl_->lowest = detail::lowest_by_lanczos(solve, impl_->free.reduced(diagonal(impl_->conditions)));
    });
    return impl_->lowest;
}

double RestStiffness::approximate_lowest_eigenvalue() const {
    return impl_->free.count() > 0 ? impl_->slowest().value : std::numeric_limits<double>::infinity();
}

const Matrix3Xd& RestStiffness::approximate_slowest_mode() const {
    return impl_->slowest().x;
}

double RestStiffness::approximate_highest_eigenvalue() const {
    std::call_once(impl_->highest_known, [this] {
        const Matrix3Xd D = diagonal(impl_->conditions);
        impl_->highest = detail::largest_eigenvalue(
            [this](const Matrix3Xd& x) { return impl_->multiply_free(x); },
            [&](const Matrix3Xd& x) -> Matrix3Xd { return x.cwiseQuotient(D); },
            impl_->conditions.constrained.select(0.0, detail::every_wave_length(impl_->position.cols())));
    });
    return impl_->highest;
}

long long RestStiffness::factor_nonzeros() const {
    return impl_->free.count() > 0 ? impl_->factor().nonzeros() : 0;
}

}  // namespace tissuewarp::tled
