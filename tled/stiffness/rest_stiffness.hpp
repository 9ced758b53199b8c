#pragma once
/// The stiffness at rest K₀ and its factor (CHOLMOD): gives the linear-elastic start, the diagonal mass, the lowest
/// frequency, and turns a residual into an error in millimetres.

#include "tled/conditions.hpp"
#include "tled/rest_state.hpp"

#include <Eigen/Core>

#include <memory>
#include <vector>

namespace tissuewarp::tled {

/// K₀ + springs, membranes and pairs (which touch at rest) of the rest configuration, constrained degrees of freedom
/// removed. Moving targets do not change it; pressures, fluid and contact are not in it. Free rigid modes are excluded
/// by the springs or prescribed displacements; without them construction throws InvalidInput ("nothing holds the
/// tissue"). What needs the factor makes it at first, once, and throws InvalidInput where the stiffness is not positive
/// definite or SolverFailure without memory for it; multiplications, diagonal and approximations do without.
class RestStiffness {
public:
    RestStiffness(const RestState& rest, const NodalConditions& conditions);
    /// The same with the pressure part V_a M_a U''(J_a) ∇J_a ∇J_aᵀ taken at `displacement` (3 × N, mm): a metric near
    /// that state, always positive definite, for tissue of which almost only the volume is stiff; factorised at once.
    /// Throws SolverFailure where det F ≤ 0 or the state is too far for the factor's digits.
    RestStiffness(const RestState& rest, const NodalConditions& conditions, const Eigen::Matrix3Xd& displacement);
    /// The same tissue, constraints and surface effects as `other` under other springs: K₀ and the analysis of its
    /// pattern are taken over, only the numbers are factorised again. Throws InvalidInput for other constraints.
    RestStiffness(const RestState& rest, const NodalConditions& conditions, const RestStiffness& other);
    /// The search for the slowest mode begins at `slowest_about` (3 × N), that of another one, needs no coarse lattice
    /// and ends earlier: up to twice too high where the slowest mode is quite another one now.
    RestStiffness(const RestState& rest, const NodalConditions& conditions, const RestStiffness& other,
                  const Eigen::Matrix3Xd& slowest_about);
    ~RestStiffness();
    RestStiffness(RestStiffness&&) noexcept;
    RestStiffness& operator=(RestStiffness&&) noexcept;

    /// Orders the unknowns and analyses the pattern of the factor now, rather than with the factor or in a copy for
    /// other springs.
    void analyse() const;
    /// Makes the factor now, rather than when it is needed first.
    void factorise() const;

    /// x with K x = f on the free degrees of freedom, zero on the constrained ones (3 × N; f in mN, x in mm). When
    /// `conditions` carry other springs than those factorised (same constraints), conjugate gradients with the factor
    /// as preconditioner solve the present system to `relative_tolerance`.
    [[nodiscard]] Eigen::Matrix3Xd solve(const Eigen::Matrix3Xd& force) const;
    [[nodiscard]] Eigen::Matrix3Xd solve(const Eigen::Matrix3Xd& force, const NodalConditions& conditions,
                                         double relative_tolerance) const;

    /// K⁻¹ of many forces at once, 3N × k, the nodes' vectors one after the other: several times as fast as one by one.
    [[nodiscard]] Eigen::MatrixXd solve_columns(const Eigen::MatrixXd& forces) const;

    /// K⁻¹ between some nodes, 3n × 3n: their displacements under forces at them (mm/mN), 0 where constrained. Of few
    /// nodes that lie together it takes a fraction of as many solves.
    [[nodiscard]] Eigen::MatrixXd inverse_between(const std::vector<int>& nodes) const;

    /// Of more nodes than this the following are found without a factor, whose entries and work grow too fast.
    static constexpr int most_factorised_nodes = 6000;
    [[nodiscard]] bool is_large() const;

    /// About K⁻¹ f, 3 × N, symmetric and positive definite: with the factor, or of a large mesh by a cycle of two
    /// levels (docs/decisions/rest_stiffness.md).
    [[nodiscard]] Eigen::Matrix3Xd precondition(const Eigen::Matrix3Xd& force) const;

    /// As solve() with a tolerance, by conjugate gradients with that as preconditioner.
    [[nodiscard]] Eigen::Matrix3Xd solve_iteratively(const Eigen::Matrix3Xd& force, const NodalConditions& conditions,
                                                     double relative_tolerance) const;

    /// Linear-elastic displacement under the conditions, imposed values included (3 × N, mm).
    [[nodiscard]] Eigen::Matrix3Xd linear_solution(const NodalConditions& conditions) const;

    /// The same to a relative error, as solve_iteratively(): of a large mesh without a factor.
    [[nodiscard]] Eigen::Matrix3Xd linear_solution(const NodalConditions& conditions, double relative_tolerance) const;

    /// K₀ u without springs, mN: the linear-elastic resistance, membranes and sliding pairs included (3 × N).
    [[nodiscard]] Eigen::Matrix3Xd elastic_resistance(const Eigen::Matrix3Xd& displacement) const;

    /// Diagonal of K₀ + springs of `conditions`, 3 × N, mN/mm; ones where constrained.
    [[nodiscard]] Eigen::Matrix3Xd diagonal(const NodalConditions& conditions) const;

    /// Smallest λ of K x = λ diag(K) x on the free degrees of freedom, by Lanczos steps with the factor.
    [[nodiscard]] double lowest_eigenvalue() const;
    /// From above within some per cent, by products with K alone: no factor is needed.
    [[nodiscard]] double approximate_lowest_eigenvalue() const;
    /// And its mode, 3 × N.
    [[nodiscard]] const Eigen::Matrix3Xd& approximate_slowest_mode() const;

    /// The largest λ of it, a tenth above what ten steps of the power method find.
    [[nodiscard]] double approximate_highest_eigenvalue() const;

    /// Non-zeros of the factor, for reports.
    [[nodiscard]] long long factor_nonzeros() const;

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// Makes both factors at the same time, each on one core.
void factorise_together(const RestStiffness& first, const RestStiffness& second);

}  // namespace tissuewarp::tled
