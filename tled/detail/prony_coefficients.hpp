#pragma once
/// Backward Euler of a Prony series for one time step: q⁺ = a S_shear + b q.

#include "tled/viscosity.hpp"

#include <array>
#include <vector>

namespace tissuewarp::tled::detail {

/// (a, b) = (Δt g/(Δt + τ), τ/(Δt + τ)) of every term; a time step of 0 leaves q as it is.
inline std::vector<std::array<double, 2>> prony_coefficients(const PronySeries& series, double time_step) {
    std::vector<std::array<double, 2>> result;
    for (const auto& [g, tau] : series.terms)
        result.push_back({time_step * g / (time_step + tau), tau / (time_step + tau)});
    return result;
}

}  // namespace tissuewarp::tled::detail
