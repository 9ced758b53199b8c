#pragma once
/// A Prony series over an interval in which S_shear stays: q⁺ = a S_shear + b q.

#include "tled/viscosity.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace tissuewarp::tled::detail {

/// (a, b) = (g (1 − e^(−h/τ)), e^(−h/τ)) of every term for an interval of h s; 0 leaves q as it is, below 0 it goes
/// back.
inline std::vector<std::array<double, 2>> prony_coefficients(const PronySeries& series, double interval) {
    std::vector<std::array<double, 2>> result;
    for (const auto& [g, tau] : series.terms)
        result.push_back({-g * std::expm1(-interval / tau), std::exp(-interval / tau)});
    return result;
}

/// Terms of the longest series.
inline std::size_t most_terms(const std::vector<PronySeries>& series) {
    std::size_t most = 0;
    for (const PronySeries& each : series) most = std::max(most, each.terms.size());
    return most;
}

/// (a, b) of as many terms for every series, zero where it has fewer: what GLSL kernels read.
inline std::vector<std::array<float, 2>> prony_table(const std::vector<PronySeries>& series, double interval) {
    const std::size_t terms = most_terms(series);
    std::vector<std::array<float, 2>> table(series.size() * terms, {0.0F, 0.0F});
    for (std::size_t m = 0; m < series.size(); ++m) {
        auto entry = table.begin() + static_cast<std::ptrdiff_t>(m * terms);
        for (const auto& [a, b] : prony_coefficients(series[m], interval))
            *entry++ = {static_cast<float>(a), static_cast<float>(b)};
    }
    return table;
}

}  // namespace tissuewarp::tled::detail
