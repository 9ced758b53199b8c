#pragma once
/// Constitutive laws: one struct each, moduli in kPa. W is the strain energy per rest volume (kPa; 1 kPa mm³ = 1 mN
/// mm), F the deformation gradient, C = FᵀF, J = det F, Ī₁ = J^(−2/3) tr C, Ī₂ = J^(−4/3) ½ (tr²C − tr C²).
///
/// Every law is split into a shear part Ψ(F) and a volumetric part M·U(J), because the averaged-pressure element
/// evaluates the second at nodes. U = (J − 1)²/2 where nothing else is said.

#include <Eigen/Core>

#include <array>
#include <map>
#include <string>
#include <variant>
#include <vector>

namespace tissuewarp::tled {

/// W = μ/2 (Ī₁ − 3) + κ/2 (J − 1)².
struct NeoHookeanIso {
    double shear_modulus = 0.0;  ///< μ, kPa
    double bulk_modulus = 0.0;   ///< κ = λ + 2μ/3, kPa
    bool operator==(const NeoHookeanIso&) const = default;
};

/// W = μ/2 (tr C − 3) − μ ln J + λ/2 (ln J)²: U = (ln J)²/2.
struct NeoHookeanLnJ {
    double shear_modulus = 0.0;  ///< μ, kPa
    double lame_lambda = 0.0;    ///< λ, kPa
    bool operator==(const NeoHookeanLnJ&) const = default;
};

/// W = μ'/2 (tr C − 3) + λ'/2 (J − α)² − μ'/2 ln(tr C + 1), α = 1 + 3μ'/(4λ'), μ' = 4μ/3, λ' = λ + 5μ/6, less its value
/// at rest (Smith, de Goes, Kim 2018, eqs. 13 and 14): finite for inverted elements, so that they find back.
struct NeoHookeanStable {
    double shear_modulus = 0.0;  ///< μ of linear elasticity, kPa
    double lame_lambda = 0.0;    ///< λ of linear elasticity, kPa
    bool operator==(const NeoHookeanStable&) const = default;
};

/// W = Σ c_ij (Ī₁ − 3)^i (Ī₂ − 3)^j + κ/2 (J − 1)² (Rivlin and Saunders 1951): Mooney–Rivlin with c10 and c01, Yeoh
/// (1993) with c10, c20 and c30.
struct Polynomial {
    double c10 = 0.0, c01 = 0.0, c20 = 0.0, c11 = 0.0, c02 = 0.0, c30 = 0.0;  ///< kPa
    double bulk_modulus = 0.0;                                                ///< κ, kPa
    bool operator==(const Polynomial&) const = default;
};
Polynomial mooney_rivlin(double c10_kpa, double c01_kpa, double bulk_modulus_kpa);
Polynomial yeoh(double c10_kpa, double c20_kpa, double c30_kpa, double bulk_modulus_kpa);

/// W = μ Σ_{i=1…5} C_i/λ_m^(2i−2) (Ī₁^i − 3^i) + κ/2 ((J² − 1)/2 − ln J), C = 1/2, 1/20, 11/1050, 19/7000,
/// 519/673750: the eight-chain model (Arruda and Boyce 1993, eq. 26) with the volumetric part that finite-element codes
/// give it, U = ((J² − 1)/2 − ln J)/2.
struct ArrudaBoyce {
    double shear_modulus = 0.0;    ///< μ, kPa; the modulus at rest is larger
    double locking_stretch = 0.0;  ///< λ_m, > 1
    double bulk_modulus = 0.0;     ///< κ, kPa
    bool operator==(const ArrudaBoyce&) const = default;
};

struct OgdenTerm {
    double modulus = 0.0;   ///< μ_p, kPa; the sign of exponent
    double exponent = 1.0;  ///< α_p, not 0
    bool operator==(const OgdenTerm&) const = default;
};
/// W = Σ_p μ_p/α_p (λ̄₁^α_p + λ̄₂^α_p + λ̄₃^α_p − 3) + κ/2 (J − 1)², λ̄ = J^(−1/3) λ (Ogden 1972). Terms with modulus 0 are
/// absent.
struct Ogden {
    std::array<OgdenTerm, 3> terms{};
    double bulk_modulus = 0.0;  ///< κ, kPa
    bool operator==(const Ogden&) const = default;
};

/// W = μ/2 (Ī₁ − 3) + η/2 (Ī₄ − 1)² + κ/2 (J − 1)², Ī₄ = J^(−2/3) a·C a, in tension and compression alike. (Codes that
/// take S = η (Ī₄ − 1) ∂Ī₄/∂C use η/4 in this energy.)
struct TransverselyIsotropic {
    double shear_modulus = 0.0;                              ///< μ, kPa
    double bulk_modulus = 0.0;                               ///< κ, kPa
    double fibre_modulus = 0.0;                              ///< η, kPa
    Eigen::Vector3d fibre = Eigen::Vector3d(0.0, 0.0, 1.0);  ///< a, unit vector of the rest configuration
    bool operator==(const TransverselyIsotropic&) const = default;
};

using Material =
    std::variant<NeoHookeanIso, NeoHookeanLnJ, NeoHookeanStable, Polynomial, ArrudaBoyce, Ogden, TransverselyIsotropic>;

/// Material of each label.
using MaterialTable = std::map<int, Material>;

/// From Young's modulus (kPa, > 0) and Poisson's ratio in (−1, 0.5). Throw InvalidInput outside.
NeoHookeanIso neo_hookean_iso(double youngs_modulus_kpa, double poisson_ratio);
NeoHookeanLnJ neo_hookean_lnj(double youngs_modulus_kpa, double poisson_ratio);
NeoHookeanStable neo_hookean_stable(double youngs_modulus_kpa, double poisson_ratio);

/// Throws InvalidInput, naming `what`, unless shear and bulk modulus at rest are positive and finite, the locking
/// stretch is above 1, exponents are not 0 and the fibre is a unit vector.
void require_valid(const Material& material, const std::string& what);

/// "neo_hookean_iso", "neo_hookean_lnj", "neo_hookean_stable", "polynomial", "arruda_boyce", "ogden",
/// "transversely_isotropic": what files call the laws.
std::string law_name(const Material& material);
/// The members of the law in the order of its declaration, kPa and mm; members of members in turn.
std::vector<double> law_parameters(const Material& material);
/// The law of that name with its members as declared. Throws InvalidInput for an unknown name.
Material material_of_law(const std::string& name);
/// Inverse of law_name and law_parameters. Throws InvalidInput also for a wrong number of parameters.
Material material_of_law(const std::string& name, const std::vector<double>& parameters);

/// μ of linear elasticity at rest, kPa; across the fibre where there is one.
double shear_modulus(const Material& material);
/// The modulus M that multiplies U(J): κ, λ or λ', kPa.
double volumetric_modulus(const Material& material);
/// Bulk modulus of linear elasticity at rest, λ + 2μ/3, kPa.
double bulk_modulus(const Material& material);
/// λ + 2μ of linear elasticity at rest, kPa, along the fibre where there is one: gives the dilatational wave speed
/// √((λ+2μ)/ρ).
double p_wave_modulus(const Material& material);
/// Poisson's ratio of linear elasticity at rest, across the fibre.
double poisson_ratio(const Material& material);

/// Whether the energy is finite for J ≤ 0, so that an inverted element pulls itself straight.
bool admits_inversion(const Material& material);

}  // namespace tissuewarp::tled
