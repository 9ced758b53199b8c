#pragma once
/// Viscoelasticity by Prony series on the shear part of any law: S = S_elastic − Σ q_i with q_i' = (g_i S_shear −
/// q_i)/τ_i (Simo and Hughes, Computational Inelasticity, 1998, section 10.2; Taylor et al. 2009). Over an interval h
/// in which S_shear stays, q⁺ = g (1 − e^(−h/τ)) S_shear + e^(−h/τ) q.

#include "tled/material.hpp"

#include <map>
#include <string>
#include <vector>

namespace tissuewarp::tled {

struct PronyTerm {
    double relative_modulus = 0.0;  ///< g_i, part of the shear stress that relaxes
    double relaxation_time = 0.0;   ///< τ_i, s
    bool operator==(const PronyTerm&) const = default;
};

/// The moduli of the material are the instantaneous ones; after long times 1 − Σ g_i of the shear stress is left.
struct PronySeries {
    std::vector<PronyTerm> terms;  ///< none: elastic
    bool operator==(const PronySeries&) const = default;
};

/// Series of each label; labels without one are elastic.
using ViscosityTable = std::map<int, PronySeries>;

/// Throws InvalidInput, naming `what`, unless every g and τ is positive and Σ g is below 1.
void require_valid(const PronySeries& series, const std::string& what);

/// 1 − Σ g_i.
double relaxed_fraction(const PronySeries& series);

/// The law with `factor` (> 0) of its shear stress and the same volumetric part: what a relaxed material answers.
Material with_shear_scaled(const Material& material, double factor);

}  // namespace tissuewarp::tled
