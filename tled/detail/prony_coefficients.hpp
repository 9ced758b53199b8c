#pragma once
/// Backward Euler of a Prony series for one time step: q⁺ = a S_shear + b q.

#include "tled/viscosity.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

namespace tissuewarp::tled::detail {

/// (a, b) = (Δt g/(Δt + τ), τ/(Δt + τ)) of every term; a time step of 0 leaves q as it is.
inline std::vector<std::array<double, 2>> prony_coefficients(const PronySeries& series, double time_step) {
    std::vector<std::array<double, 2>> result;
    for (const auto& [g, tau] : series.terms)
        result.push_back({time_step * g / (time_step + tau), tau / (time_step + tau)});
    return result;
}

/// Terms of the longest series.
inline std::size_t most_terms(const std::vector<PronySeries>& series) {
    std::size_t most = 0;
    for (const PronySeries& each : series) most = std::max(most, each.terms.size());
    return most;
}

/// (a, b) of as many terms for every series, zero where it has fewer: what GLSL kernels read.
inline std::vector<std::array<float, 2>> prony_table(const std::vector<PronySeries>& series, double time_step) {
    const std::size_t terms = most_terms(series);
    std::vector<std::array<float, 2>> table(series.size() * terms, {0.0F, 0.0F});
    for (std::size_t m = 0; m < series.size(); ++m) {
        auto entry = table.begin() + static_cast<std::ptrdiff_t>(m * terms);
        for (const auto& [a, b] : prony_coefficients(series[m], time_step))
            *entry++ = {static_cast<float>(a), static_cast<float>(b)};
    }
    return table;
}

}  // namespace tissuewarp::tled::detail
