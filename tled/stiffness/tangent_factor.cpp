#include "tled/stiffness/tangent_factor.hpp"

#include "tled/model/springs.hpp"
#include "tled/stiffness/conjugate_gradients.hpp"
#include "tled/stiffness/effect_stiffness.hpp"

namespace tissuewarp::tled::detail {

using Eigen::Matrix3Xd;

namespace {

constexpr int most_iterations = 20;  // of conjugate gradients, each a solve with the factor
constexpr double relative_tolerance = 0.05;

}  // namespace

TangentFactor::TangentFactor(const RestState& rest, const NodalConditions& conditions)
    : rest_(rest), conditions_(conditions), free_(conditions.constrained) {}

namespace {

Stiffness with_effects(Stiffness tissue, const RestState& rest, const NodalConditions& conditions) {
    add_effects(conditions.effects.surface, rest.position, tissue);
    for (std::size_t s = 0; s < conditions.spring_node.size(); ++s)
        tissue.elements.diagonal(conditions.spring_node[s]) += spring_matrix(conditions, static_cast<int>(s));
    return tissue;
}

}  // namespace

Stiffness tangent_at(const RestState& rest, const NodalConditions& conditions, const Matrix3Xd& displacement) {
    return with_effects(stiffness(rest, displacement), rest, conditions);
}

Product tangent_product(const RestState& rest, const NodalConditions& conditions, const Matrix3Xd& displacement) {
    return [&conditions, tangent = std::make_shared<Stiffness>(tangent_at(rest, conditions, displacement))](
               const Matrix3Xd& x) -> Matrix3Xd { return conditions.constrained.select(0.0, tangent->multiply(x)); };
}

bool TangentFactor::factorise(const Matrix3Xd& displacement) {
    stable_ = factorised(tangent_at(rest_, conditions_, displacement));
    return stable_ || factorised(with_effects(positive_stiffness(rest_, displacement), rest_, conditions_));
}

bool TangentFactor::factorised(const Stiffness& stiffness) {
    const auto lower = scalar_matrix(assembled(stiffness, Triangle::Lower), free_.index(), Triangle::Lower);
    if (!factor_) factor_ = std::make_unique<CholmodFactor>(lower, free_.nodes());
    return factor_->factorize(lower);
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
