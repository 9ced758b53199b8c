#pragma once
/// The explicit step with mass diag K₀ as the heavy-ball iteration on M⁻¹K, whose optimal coefficients follow from the
/// extreme eigenvalues (Polyak 1964).

#include "tled/statics/equilibrium_search.hpp"

namespace tissuewarp::tled::detail {

/// Of M⁻¹K.
struct Spectrum {
    double lowest = 0, highest = 0;
};

/// c = 4/(√λ_max + √λ_min)², ρ = ((√λ_max − √λ_min)/(√λ_max + √λ_min))². Every error falls by √ρ a step.
StepCoefficients heavy_ball(const Spectrum& spectrum);

/// Neper by which errors fall in a step.
double decay(const Spectrum& spectrum);

/// At the last good state, whose residual is given: λ_max by Lanczos' iteration (Golub and Van Loan, section 10.1) on
/// M^(−½) K M^(−½), with products by differences of the real force kernel; λ_min from `lowest_at_rest`, that of K₀ with
/// the springs of the stiffness, and of shifts of the whole under the present ones. Leaves the engine at that state, at
/// rest. Fails where no λ_max above 0 is found.
Spectrum spectrum_at(EquilibriumSearch& search, const Eigen::Matrix3Xd& mass, const Eigen::Matrix3Xd& residual,
                     double lowest_at_rest);

/// Of a λ_max that is known from elsewhere, with a reserve for what has changed since. The engine stays as it is.
Spectrum spectrum_of(double highest, const EquilibriumSearch& search, const Eigen::Matrix3Xd& mass,
                     double lowest_at_rest);

/// After steps that inverted tissue, for the `restarts`th time: back to the last good state, at rest, with a note.
/// Fails where that state is none, or after six.
void go_back(EquilibriumSearch& search, int restarts);

/// With λ_max taken 2^restarts times as large.
Spectrum shortened(Spectrum spectrum, int restarts);

}  // namespace tissuewarp::tled::detail
