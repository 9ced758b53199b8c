#pragma once
/// The column that several verification cases of effects share: 100 mm on a square of 10 mm, sides that cannot move
/// sideways, so that one stretch λ(X) along z tells all.

#include "tests/verification/transient.hpp"
#include "tled/conditions.hpp"

#include <functional>

namespace tissuewarp::verification::effects {

constexpr double gravity = 9810.0;              // mm/s²
constexpr double density = 1e-6;                // kg/mm³
constexpr double modulus = 3.0, poisson = 0.3;  // kPa, of columns
constexpr double length = 100.0, side = 10.0;   // mm, of columns

tled::Model column(int cells);
/// λ under the stress P (kPa) of W = μ/2 (λ^(−2/3) (2 + λ²) − 3) + κ/2 (λ − 1)².
double column_stretch(double stress);
/// ∫ λ(P(X)) dX over [from, to] by Simpson's rule.
double deformed_length(const std::function<double(double)>& stress, double from, double to);
/// Of the top under the column's own weight, mm: P(X) = −ρ g (L − X).
double sag_of_column();
/// Holds the sides; the column stands on its base, or its base may move upright too.
void guide(const tled::Model& model, bool base_held, tled::Conditions& conditions);

Eigen::Matrix3Xd weight(const tled::RestState& rest, const Eigen::Vector3d& pull);
/// Of a component over the nodes whose rest position satisfies `on`.
double mean(const tled::Model& model, const Eigen::Matrix3Xd& u, int component,
            const std::function<bool(const Eigen::Vector3d&)>& on);
bool on_top(const Eigen::Vector3d& X);
/// Displacement of the equilibrium.
Eigen::Matrix3Xd settle(const tled::Model& model, const tled::Conditions& conditions, const MakeEngine& make,
                        double tolerance_mm = 1e-3);

}  // namespace tissuewarp::verification::effects
