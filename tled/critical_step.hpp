#pragma once
/// How large a time step may be: Δt ≤ 2/ω for the highest frequency ω of the discrete model (Belytschko, Liu, Moran,
/// Nonlinear Finite Elements for Continua and Structures, 2000, section 6.6).

#include "tled/engine.hpp"

#include <Eigen/Core>

namespace tissuewarp::tled {

/// The highest mode of M⁻¹K, found from below.
struct HighestMode {
    double eigenvalue = 0;   ///< 1/s² for a mass in kg; without dimension for a mass in mN/mm
    Eigen::Matrix3Xd shape;  ///< 3 × N, largest node of length 1; zero where constrained
    int force_evaluations = 0;
};

/// Power iteration through the engine's own force kernel at a displacement (3 × N mm), from `start` or a fixed vector
/// that holds every frequency, so that repeated runs give the same bits. `mass` is the engine's. Leaves the engine at
/// the displacement with zero increment and forgets viscous stresses, which do not stiffen the response. The estimate
/// is a Rayleigh quotient, so never above the true value: with 20 iterations 1 to 5 % below.
HighestMode highest_mode(Engine& engine, const Eigen::Matrix3Xd& mass, const Eigen::Matrix3Xd& displacement,
                         int iterations = 20, const Eigen::Matrix3Xd* start = nullptr);

/// 2/ω of each tetrahedron alone at rest (s, in the internal order): ω² ≤ 4/ρ (λ tr G + 2μ λ_max(G)), G = Σ ∇N ∇Nᵀ. No
/// step below the smallest is unstable at rest; the true limit is 1.2 to 3 times larger.
Eigen::VectorXd element_step_bounds(const RestState& rest, double density);

/// Mass added to the elements that would need a smaller time step than asked for.
struct MassScaling {
    Eigen::Matrix3Xd mass;      ///< 3 × N, kg, for Engine::set_mass
    double added_fraction = 0;  ///< of the mass of the tissue
    int scaled_elements = 0;
};

/// Raises the density of every element whose bound is below `step` (s) until it reaches it. Statics is not changed,
/// dynamics is: report the fraction.
MassScaling scaled_mass(const RestState& rest, double density, double step);

}  // namespace tissuewarp::tled
