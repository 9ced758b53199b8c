#pragma once
/// Constitutive laws: one struct each, moduli in kPa. W is the strain energy per rest volume (kPa; 1 kPa mm³ = 1 mN
/// mm), F the deformation gradient, C = FᵀF, J = det F.
///
/// Every law is split into a shear part Ψ(F) and a volumetric part M·U(J), because the averaged-pressure element
/// evaluates the second at nodes.

#include <map>
#include <variant>

namespace tissuewarp::tled {

/// W = μ/2 (J^(−2/3) tr C − 3) + κ/2 (J − 1)²: Ψ is isochoric, U = (J − 1)²/2.
struct NeoHookeanIso {
    double shear_modulus = 0.0;  ///< μ, kPa
    double bulk_modulus = 0.0;   ///< κ = λ + 2μ/3, kPa
};

/// W = μ/2 (tr C − 3) − μ ln J + λ/2 (ln J)²: U = (ln J)²/2.
struct NeoHookeanLnJ {
    double shear_modulus = 0.0;  ///< μ, kPa
    double lame_lambda = 0.0;    ///< λ, kPa
};

using Material = std::variant<NeoHookeanIso, NeoHookeanLnJ>;

/// Material of each label.
using MaterialTable = std::map<int, Material>;

/// From Young's modulus (kPa, > 0) and Poisson's ratio in (−1, 0.5). Throw InvalidInput outside.
NeoHookeanIso neo_hookean_iso(double youngs_modulus_kpa, double poisson_ratio);
NeoHookeanLnJ neo_hookean_lnj(double youngs_modulus_kpa, double poisson_ratio);

/// μ, kPa.
double shear_modulus(const Material& material);
/// The modulus M that multiplies U(J): κ or λ, kPa.
double volumetric_modulus(const Material& material);
/// λ + 2μ of linear elasticity at rest, kPa: gives the dilatational wave speed √((λ+2μ)/ρ).
double p_wave_modulus(const Material& material);
/// Poisson's ratio of linear elasticity at rest.
double poisson_ratio(const Material& material);

}  // namespace tissuewarp::tled
