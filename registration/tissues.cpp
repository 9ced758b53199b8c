#include "registration/tissues.hpp"

#include "core/errors.hpp"

#include <algorithm>

namespace tissuewarp::registration {

namespace {

// Moduli are those of slow motion. Tissue full of water keeps its volume within seconds and gives some off within
// minutes, for which 0.45 stands (Ferrant et al., IEEE Trans Med Imaging 20 (2001) 1384). Shear moduli μ of
// elastography are taken as a third of Young's.
std::vector<Tissue> table() {
    const auto soft = [](double youngs_modulus, double poissons_ratio) {
        return tled::neo_hookean_lnj(youngs_modulus, poissons_ratio);
    };
    constexpr double watery = 1.1;  // changes of volume that labels and their smoothing bring about
    const double usual = TissuePrior().expected_strain, near = BlockMatchingOptions().search_mm;
    // clang-format off
    return {
        // name      E kPa, ν            free   growth  strain  search  source
        {"default",  soft( 3.0, 0.45),   0,     watery,  usual,  near,   "as brain"},
        {"brain",    soft( 3.0, 0.45),   0,     watery,  usual,  near,   "Ferrant et al., IEEE Trans Med Imaging 20 (2001) 1384; E 2.5: Miller and Chinzei, J Biomech 35 (2002) 483"},
        {"lung",     soft( 1.0, 0.25),   0.5,   5.0,    0.5,    32,     "E and nu of models: Werner et al., Med Phys 36 (2009) 1500; nu and stretch chosen in docs/decisions/large_motion.md"},
        {"liver",    soft( 6.0, 0.45),   0,     watery,  usual,  near,   "shear modulus 2: Venkatesh, Yin and Ehman, J Magn Reson Imaging 37 (2013) 544"},
        {"prostate", soft(60.0, 0.45),   0,     watery,  usual,  near,   "Krouskop et al., Ultrason Imaging 20 (1998) 260"},
        {"breast",   soft( 3.2, 0.45),   0,     watery,  usual,  near,   "Samani, Zubovits and Plewes, Phys Med Biol 52 (2007) 1565"},
        {"kidney",   soft(14.0, 0.45),   0,     watery,  usual,  near,   "shear modulus 4.7: Rouviere et al., J Magn Reson Imaging 34 (2011) 880"},
        {"muscle",   soft(11.0, 0.45),   0,     watery,  usual,  near,   "shear modulus 3.7 at rest: Bensamoun et al., J Magn Reson Imaging 23 (2006) 242"},
        {"tumour",   soft(12.0, 0.45),   0,     watery,  usual,  near,   "several times as stiff as what is around: Samani, Zubovits and Plewes, Phys Med Biol 52 (2007) 1565"},
    };
    // clang-format on
}

}  // namespace

const std::vector<Tissue>& tissues() {
    static const std::vector<Tissue> all = table();
    return all;
}

const Tissue& tissue_named(const std::string& name) {
    const auto found =
        std::find_if(tissues().begin(), tissues().end(), [&](const Tissue& tissue) { return tissue.name == name; });
    if (found != tissues().end()) return *found;
    std::string names;
    for (const Tissue& tissue : tissues()) names += (names.empty() ? "" : ", ") + tissue.name;
    throw InvalidInput("no tissue is called '" + name + "'; give one of " + names);
}

void expect_motion_of(const Tissue& tissue, UpdateOptions& options) {
    options.tissue.expected_strain = tissue.expected_strain;
    options.image.matching.search_mm = tissue.search_mm;
}

}  // namespace tissuewarp::registration
