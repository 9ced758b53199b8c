#pragma once
/// What surface effects add to the stiffness at rest.

#include "tled/nodal_effects.hpp"
#include "tled/stiffness/stiffness.hpp"

namespace tissuewarp::tled::detail {

/// Adds pairs, which touch at rest whether they may part or not, and membranes to K, as rows k g gᵀ: a pair is one of
/// two nodes; a membrane's second variation at rest is 2 μ V (ε₁₁² + ε₂₂² + 2 ε₁₂² + (ε₁₁ + ε₂₂)²)/2, four of three
/// nodes. Pressures have none there.
void add_effects(const SurfaceEffects& effects, const Eigen::Matrix3Xd& position, Stiffness& stiffness);

}  // namespace tissuewarp::tled::detail
