#include "study/detail/random_tissue.hpp"

#include <array>
#include <functional>

namespace tissuewarp::study::detail {

namespace {

using MakeMaterial = std::function<tled::Material(double shear_kpa, double bulk_kpa)>;

struct Law {
    std::string name;
    MakeMaterial make;
};

/// Laws whose shear modulus at rest is the one given.
Law random_law(Random& random) {
    const double share = random.uniform(0.2, 0.8), growth = random.uniform(0.2, 2), exponent = random.uniform(2, 8);
    const std::array<Law, 5> laws{{
        {"neo-Hookean in ln J",
         [](double mu, double kappa) {
             return tled::NeoHookeanLnJ{mu, kappa - 2 * mu / 3};
         }},
        {"neo-Hookean",
         [](double mu, double kappa) {
             return tled::NeoHookeanIso{mu, kappa};
         }},
        {"Mooney-Rivlin",  // μ = 2 (c10 + c01)
         [share](double mu, double kappa) {
             return tled::mooney_rivlin(0.5 * mu * share, 0.5 * mu * (1 - share), kappa);
         }},
        {"Yeoh",  // μ = 2 c10
         [growth](double mu, double kappa) { return tled::yeoh(0.5 * mu, 0.5 * mu * growth, 0, kappa); }},
        {"Ogden",  // μ = ½ Σ μ_p α_p
         [share, exponent](double mu, double kappa) {
             return tled::Ogden{{{{2 * mu * share / exponent, exponent}, {-mu * (1 - share), -2.0}, {}}}, kappa};
         }},
    }};
    return laws[static_cast<std::size_t>(random.index(int(laws.size())))];
}

}  // namespace

RandomTissue random_tissue(Random& random) {
    RandomTissue tissue;
    const Law law = random_law(random);
    tissue.law = law.name;
    tissue.youngs_modulus_kpa = random.log_uniform(1, 10);
    tissue.poisson_ratio = random.uniform(0.40, 0.49);
    tissue.stiffness_ratio = random.log_uniform(0.5, 10);
    for (const auto& [label, ratio] : {std::pair{1, 1.0}, std::pair{2, tissue.stiffness_ratio}}) {
        const double modulus = ratio * tissue.youngs_modulus_kpa;
        tissue.materials[label] =
            law.make(modulus / (2 * (1 + tissue.poisson_ratio)), modulus / (3 * (1 - 2 * tissue.poisson_ratio)));
    }
    return tissue;
}

}  // namespace tissuewarp::study::detail
