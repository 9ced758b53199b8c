#pragma once
/// The tangent stiffness at a state, and systems of it solved, for Newton's method.

#include "tled/conditions.hpp"
#include "tled/rest_state.hpp"
#include "tled/stiffness/cholmod_factor.hpp"
#include "tled/stiffness/free_degrees.hpp"
#include "tled/stiffness/product.hpp"
#include "tled/stiffness/stiffness.hpp"

#include <memory>
#include <optional>

namespace tissuewarp::tled::detail {

/// ∂²E/∂u² at a displacement (3 × N, mm) of the tissue and its springs, membranes and sliding pairs as at rest;
/// pressures, fluid and contact are not in it. Throws SolverFailure where det F ≤ 0.
Stiffness tangent_at(const RestState& rest, const NodalConditions& conditions, const Eigen::Matrix3Xd& displacement);
/// Products with it on the free degrees of freedom, 0 on the others.
Product tangent_product(const RestState& rest, const NodalConditions& conditions, const Eigen::Matrix3Xd& displacement);

/// The same factorised, at one state after the other.
class TangentFactor {
public:
    /// Of tissue that outlives this, under conditions that constrain these degrees of freedom (3 × N).
    TangentFactor(const RestState& rest, const Eigen::Matrix<bool, 3, Eigen::Dynamic>& constrained);

    /// Factorises the tangent at a displacement (3 × N, mm), where it is indefinite without what is negative in its
    /// tetrahedra: it then leads downhill. False where that is not positive definite either. Throws SolverFailure where
    /// det F ≤ 0.
    [[nodiscard]] bool factorise(const NodalConditions& conditions, const Eigen::Matrix3Xd& displacement);
    /// The same of a tangent that is known to be indefinite.
    [[nodiscard]] bool factorise_positive_part(const NodalConditions& conditions, const Eigen::Matrix3Xd& displacement);
    /// Whether the tangent of the last factorise() was positive definite.
    [[nodiscard]] bool stable() const { return stable_; }

    /// K⁻¹ f on the free degrees of freedom, 0 on the others (3 × N; mN, mm). Precondition: factorise() was true.
    [[nodiscard]] Eigen::Matrix3Xd solve(const Eigen::Matrix3Xd& force) const;

    /// What the factor of another state prepares.
    struct Prepared {
        std::optional<Eigen::Matrix3Xd> x;  ///< none where it would take longer than a factor
        bool positive = true;               ///< K along every direction seen
        Eigen::Matrix3Xd falling;           ///< a direction along which it is not
    };
    /// The same of the tangent at another displacement, to a few percent, by conjugate gradients, which the last factor
    /// prepares; of its positive part where it is not positive along them. Throws SolverFailure where det F ≤ 0.
    [[nodiscard]] Prepared solve_at(const NodalConditions& conditions, const Eigen::Matrix3Xd& displacement,
                                    const Eigen::Matrix3Xd& force) const;

private:
    [[nodiscard]] bool factorise(const Stiffness& stiffness);

    const RestState& rest_;
    FreeDegrees free_;
    std::unique_ptr<CholmodFactor> factor_;
    bool factorised_ = false;
    bool stable_ = false;
};

}  // namespace tissuewarp::tled::detail
