#include "tled/stiffness/tangent_factor.hpp"

#include "tled/model/springs.hpp"
#include "tled/stiffness/effect_stiffness.hpp"
#include "tled/stiffness/stiffness.hpp"

namespace tissuewarp::tled::detail {

using Eigen::Matrix3Xd;

namespace {

constexpr double first_shift = 1e-6, shift_growth = 10, last_shift = 1e3;  // of the diagonal

}  // namespace

TangentFactor::TangentFactor(const RestState& rest, const NodalConditions& conditions)
    : rest_(rest), conditions_(conditions), free_(conditions.constrained) {}

bool TangentFactor::factorise(const Matrix3Xd& displacement) {
    Stiffness tangent = stiffness(rest_, displacement);
    add_effects(conditions_.effects.surface, rest_.position, tangent);
    BlockRows rows = assembled(tangent, Triangle::Lower);
    for (std::size_t s = 0; s < conditions_.spring_node.size(); ++s)
        rows.diagonal(conditions_.spring_node[s]) += spring_matrix(conditions_, static_cast<int>(s));
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

Matrix3Xd TangentFactor::solve(const Matrix3Xd& force) const {
    return free_.expanded(factor_->solve(free_.reduced(force)));
}

}  // namespace tissuewarp::tled::detail
