#include "tled/material.hpp"

#include "core/errors.hpp"

#include <cmath>
#include <string>

namespace tissuewarp::tled {

namespace {

struct Lame {
    double lambda, mu;  // kPa
};

Lame lame(double youngs_modulus_kpa, double poisson) {
    if (!(youngs_modulus_kpa > 0) || !std::isfinite(youngs_modulus_kpa))
        throw InvalidInput("Young's modulus is " + std::to_string(youngs_modulus_kpa) + " kPa; it must be positive");
    if (!(poisson > -1.0 && poisson < 0.5))
        throw InvalidInput("Poisson's ratio is " + std::to_string(poisson) +
                           "; it must lie between -1 and 0.5 (below)");
    return {youngs_modulus_kpa * poisson / ((1 + poisson) * (1 - 2 * poisson)),
            youngs_modulus_kpa / (2 * (1 + poisson))};
}

/// λ of linear elasticity at rest, kPa.
double lame_lambda(const Material& material) {
    if (const auto* iso = std::get_if<NeoHookeanIso>(&material)) return iso->bulk_modulus - 2 * iso->shear_modulus / 3;
    return std::get<NeoHookeanLnJ>(material).lame_lambda;
}

}  // namespace

NeoHookeanIso neo_hookean_iso(double youngs_modulus_kpa, double poisson) {
    const auto [lambda, mu] = lame(youngs_modulus_kpa, poisson);
    return {mu, lambda + 2 * mu / 3};
}

NeoHookeanLnJ neo_hookean_lnj(double youngs_modulus_kpa, double poisson) {
    const auto [lambda, mu] = lame(youngs_modulus_kpa, poisson);
    return {mu, lambda};
}

double shear_modulus(const Material& material) {
    return std::visit([](const auto& law) { return law.shear_modulus; }, material);
}

double volumetric_modulus(const Material& material) {
    if (const auto* iso = std::get_if<NeoHookeanIso>(&material)) return iso->bulk_modulus;
    return std::get<NeoHookeanLnJ>(material).lame_lambda;
}

double p_wave_modulus(const Material& material) {
    return lame_lambda(material) + 2 * shear_modulus(material);
}

double poisson_ratio(const Material& material) {
    const double lambda = lame_lambda(material);
    return lambda / (2 * (lambda + shear_modulus(material)));
}

}  // namespace tissuewarp::tled
