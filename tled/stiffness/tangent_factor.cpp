#include "tled/stiffness/tangent_factor.hpp"

#include "tled/model/springs.hpp"
#include "tled/stiffness/conjugate_gradients.hpp"
#include "tled/stiffness/effect_stiffness.hpp"

#include <algorithm>
#include <utility>

namespace tissuewarp::tled::detail {

using Eigen::Matrix3Xd;

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

namespace {

Product product_of(Stiffness stiffness, const NodalConditions& conditions) {
    return [&conditions, kept = std::make_shared<Stiffness>(std::move(stiffness))](const Matrix3Xd& x) -> Matrix3Xd {
        return conditions.constrained.select(0.0, kept->multiply(x));
    };
}

}  // namespace

Product tangent_product(const RestState& rest, const NodalConditions& conditions, const Matrix3Xd& displacement) {
    return product_of(tangent_at(rest, conditions, displacement), conditions);
}

TangentFactor::TangentFactor(const RestState& rest, const Eigen::Matrix<bool, 3, Eigen::Dynamic>& constrained)
    : rest_(rest), free_(constrained) {}

bool TangentFactor::factorise(const NodalConditions& conditions, const Matrix3Xd& displacement) {
    stable_ = factorise(tangent_at(rest_, conditions, displacement));
    return stable_ || factorise_positive_part(conditions, displacement);
}

bool TangentFactor::factorise_positive_part(const NodalConditions& conditions, const Matrix3Xd& displacement) {
    stable_ = false;
    return factorise(with_effects(positive_stiffness(rest_, displacement), rest_, conditions));
}

bool TangentFactor::factorise(const Stiffness& stiffness) {
    const auto lower = scalar_matrix(assembled(stiffness, Triangle::Lower), free_.index(), Triangle::Lower);
    if (!factor_) factor_ = std::make_unique<CholmodFactor>(lower, free_.nodes());
    factorised_ = factor_->factorize(lower);
    return factorised_;
}

TangentFactor::Prepared TangentFactor::solve_at(const NodalConditions& conditions, const Matrix3Xd& displacement,
                                                const Matrix3Xd& force) const {
    constexpr double relative_tolerance = 0.05;
    constexpr int fewest = 20;  // iterations before a factor is thought of, each a solve with the last one
    Prepared prepared;
    if (!factorised_) return prepared;
    const int most = std::max(fewest, static_cast<int>(0.5 * factor_->solves_per_factor()));
    const auto solved = [&](const Product& product) {
        ConjugateGradients found = conjugate_gradients_within(
            most, product, [&](const Matrix3Xd& f) { return solve(f); }, conditions.constrained.select(0.0, force),
            relative_tolerance);
        if (found.positive && found.relative_residual <= relative_tolerance) prepared.x = std::move(found.x);
        return found;
    };
    ConjugateGradients along_tangent = solved(tangent_product(rest_, conditions, displacement));
    prepared.positive = along_tangent.positive;
    if (prepared.positive) return prepared;
    prepared.falling = std::move(along_tangent.last);
    solved(product_of(with_effects(positive_stiffness(rest_, displacement), rest_, conditions), conditions));
    return prepared;
}

Matrix3Xd TangentFactor::solve(const Matrix3Xd& force) const {
    return free_.expanded(factor_->solve(free_.reduced(force)));
}

}  // namespace tissuewarp::tled::detail
