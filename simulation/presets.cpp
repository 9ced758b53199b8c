#include "simulation/presets.hpp"

#include "core/errors.hpp"

#include <algorithm>

namespace tissuewarp::simulation {

namespace {

constexpr double near_incompressible = 0.49;  // Poisson's ratio where a source gives none

/// κ = 2μ(1 + ν)/(3(1 − 2ν)).
double bulk_modulus(double shear_modulus, double poisson_ratio) {
    return 2 * shear_modulus * (1 + poisson_ratio) / (3 * (1 - 2 * poisson_ratio));
}

tled::Material brain_in_tension() {
    constexpr double mu = 0.842, alpha = -4.7;  // kPa; W = 2μ/α² (Σ λ^α − 3), ours is μ_p/α_p (Σ λ^α_p − 3)
    tled::Ogden law;
    law.terms[0] = {2 * mu / alpha, alpha};
    law.bulk_modulus = bulk_modulus(mu, near_incompressible);
    return law;
}

tled::Material neo_hookean(double youngs_modulus) {
    return tled::neo_hookean_lnj(youngs_modulus, near_incompressible);
}

const std::string poisson_choice = "Poisson's ratio 0.49 and the neo-Hookean law";
const std::string samani =
    "Samani, Zubovits, Plewes, Phys. Med. Biol. 52 (2007) 1565: small-strain Young's modulus of excised tissue, ";

}  // namespace

const std::vector<Preset>& presets() {
    static const std::vector<Preset> all{
        {"brain-miller-chinzei",
         brain_in_tension(),
         {{{0.450, 0.50}, {0.365, 50.0}}},
         "Miller, Chinzei, J. Biomech. 35 (2002) 483: swine brain in tension and compression, instantaneous shear "
         "modulus 0.842 kPa, exponent -4.7, relaxing by 0.450 in 0.50 s and 0.365 in 50 s",
         "Poisson's ratio 0.49 at rest (the source takes the tissue as incompressible)"},
        {"brain-taylor-2007",
         tled::NeoHookeanLnJ{1.007, 49.329},
         {},
         "Taylor, Cheng, Ourselin, MICCAI 2007: Lame's constants 1.007 and 49.329 kPa, which are Young's modulus 3 kPa "
         "and "
         "Poisson's ratio 0.49",
         "none"},
        {"liver-elastography",
         tled::NeoHookeanIso{2.09, bulk_modulus(2.09, near_incompressible)},
         {},
         "Venkatesh et al., J. Magn. Reson. Imaging 39 (2014) 1: magnetic resonance elastography of 41 healthy "
         "volunteers, "
         "shear stiffness 2.09 +- 0.22 kPa",
         poisson_choice + "; slow loads meet a softer liver"},
        {"breast-fat", neo_hookean(3.25), {}, samani + "3.25 +- 0.91 kPa", poisson_choice},
        {"breast-fibroglandular", neo_hookean(3.24), {}, samani + "3.24 +- 0.61 kPa", poisson_choice},
        {"breast-invasive-ductal-carcinoma",
         neo_hookean(42.52),
         {},
         samani + "42.52 +- 12.47 kPa, of high grade",
         poisson_choice},
    };
    return all;
}

const Preset& preset(const std::string& name) {
    const auto found =
        std::find_if(presets().begin(), presets().end(), [&](const Preset& preset) { return preset.name == name; });
    if (found != presets().end()) return *found;
    std::string names;
    for (const Preset& each : presets()) names += (names.empty() ? "" : ", ") + each.name;
    throw InvalidInput("there is no tissue named '" + name + "'; there are " + names);
}

}  // namespace tissuewarp::simulation
