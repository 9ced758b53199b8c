#pragma once
/// Smooth displacements of a body, which are few: its stiffness among them, and what moves slowest in outline.

#include "tled/conditions.hpp"
#include "tled/stiffness/cholmod_factor.hpp"
#include "tled/stiffness/lattice.hpp"

#include <Eigen/Core>

namespace tissuewarp::tled::detail {

/// Of Pᵀ K P (galerkin()). Throws InvalidInput where K is not positive definite.
CholmodFactor smooth_factor(BlockRows K);

/// Made once for stiffnesses that differ in springs alone.
class SmoothSpace {
public:
    /// K₀ without springs, with all its rows, zero in rows and columns of constrained degrees of freedom.
    SmoothSpace(const BlockRows& elastic, const Eigen::Matrix3Xd& position,
                const Eigen::Matrix<bool, 3, Eigen::Dynamic>& constrained);

    /// About the x of least xᵀ (K₀ + springs) x / xᵀ D x among smooth displacements, by inverse iteration (Parlett, The
    /// Symmetric Eigenvalue Problem (1998), section 4.2); D (3 × N) is diagonal. 3 × N, zero where constrained.
    [[nodiscard]] Eigen::Matrix3Xd slowest(const NodalConditions& springs, const Eigen::Matrix3Xd& D) const;

private:
    Lattice lattice_;
    Eigen::Matrix<bool, 3, Eigen::Dynamic> constrained_;
    BlockRows elastic_;       // Pᵀ K₀ P
    CholmodFactor analysis_;  // of its pattern, without numbers
};

}  // namespace tissuewarp::tled::detail
