#pragma once
/// What the element kernels of both engines know of a material: the constants of its shear stress.

#include "tled/material.hpp"

#include <array>

namespace tissuewarp::tled::detail {

/// Numbers in the order that a law's kernel reads them (kPa and exponents), the rest zero:
/// neo-Hookean iso and lnJ: μ; stable: μ' = 4μ/3; polynomial: c10 c01 c20 c11 c02 c30; Arruda–Boyce: k_1 … k_5 of
/// ∂Ψ/∂Ī₁ = Σ k_i Ī₁^(i−1); Ogden: μ_1 α_1 μ_2 α_2 μ_3 α_3; transversely isotropic: μ η.
using KernelParameters = std::array<double, 8>;

KernelParameters kernel_parameters(const Material& material);

}  // namespace tissuewarp::tled::detail
