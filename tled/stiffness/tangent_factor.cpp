#include "tled/stiffness/tangent_factor.hpp"

#include "tled/model/springs.hpp"
#include "tled/stiffness/conjugate_gradients.hpp"
#include "tled/stiffness/effect_stiffness.hpp"

namespace tissuewarp::tled::detail {

using Eigen::Matrix3Xd;

namespace {

constexpr int most_iterations = 20;  // of conjugate gradients, each a solve with the factor
constexpr double relative_tolerance = 0.05;
constexpr double first_shift = 1e-6, shift_growth = 10, last_shift = 1e3;  // of the diagonal

}  // namespace

TangentFactor::TangentFactor(const RestState& rest, const NodalConditions& conditions)
    : rest_(rest), conditions_(conditions), free_(conditions.constrained) {}

Stiffness tangent_at(const RestState& rest, const NodalConditions& conditions, const Matrix3Xd& displacement) {
    Stiffness tangent = stiffness(rest, displacement);
    add_effects(conditions.effects.surface, rest.position, tangent);
    for (std::size_t s = 0; s < conditions.spring_node.size(); ++s)
        tangent.elements.diagonal(conditions.spring_node[s]) += spring_matrix(conditions, static_cast<int>(s));
    return tangent;
}

Product tangent_product(const RestState& rest, const NodalConditions& conditions, const Matrix3Xd& displacement) {
    return [&conditions, tangent = std::make_shared<Stiffness>(tangent_at(rest, conditions, displacement))](
               const Matrix3Xd& x) -> Matrix3Xd { return conditions.constrained.select(0.0, tangent->multiply(x)); };
}

bool TangentFactor::factorise(const Matrix3Xd& displacement) {
    const BlockRows rows = assembled(tangent_at(rest_, conditions_, displacement), Triangle::Lower);
    Eigen::SparseMatrix<double> lower = scalar_matrix(rows, free_.index(), Triangle::Lower);
    if (!factor_) factor_ = std::make_unique<CholmodFactor>(lower, free_.nodes());
    const Eigen::VectorXd diagonal = lower.diagonal();
    shift_ = 0;
    while (!factor_->factorize(lower)) {
        shift_ = shift_ > 0 ? shift_growth * shift_ : first_shift;
        if (shift_ > last_shift) return false;
        lower.diagonal() = diagonal + shift_ * diagonal.cwiseAbs();
    }
    return true;
}

std::optional<Matrix3Xd> TangentFactor::solve_at(const Matrix3Xd& displacement, const Matrix3Xd& force) const {
    if (!factor_) return std::nullopt;
    ConjugateGradients found = conjugate_gradients_within(
        most_iterations, tangent_product(rest_, conditions_, displacement),
        [&](const Matrix3Xd& f) { return solve(f); }, conditions_.constrained.select(0.0, force), relative_tolerance);
    if (!found.positive || found.relative_residual > relative_tolerance) return std::nullopt;
    return std::move(found.x);
}

Matrix3Xd TangentFactor::solve(const Matrix3Xd& force) const {
    return free_.expanded(factor_->solve(free_.reduced(force)));
}

}  // namespace tissuewarp::tled::detail
