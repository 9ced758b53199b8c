#include "tled/material.hpp"

#include "core/errors.hpp"

#include <cmath>
#include <concepts>
#include <string>
#include <type_traits>

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

// One overload per law and property; a new law that lacks one does not compile.

struct Names {
    std::string operator()(const NeoHookeanIso&) const { return "neo_hookean_iso"; }
    std::string operator()(const NeoHookeanLnJ&) const { return "neo_hookean_lnj"; }
    std::string operator()(const NeoHookeanStable&) const { return "neo_hookean_stable"; }
    std::string operator()(const Polynomial&) const { return "polynomial"; }
    std::string operator()(const ArrudaBoyce&) const { return "arruda_boyce"; }
    std::string operator()(const Ogden&) const { return "ogden"; }
    std::string operator()(const TransverselyIsotropic&) const { return "transversely_isotropic"; }
};

/// Calls `visit` with every scalar member of a law, in the order of declaration.
template <class Law, class Visit>
requires std::same_as<std::remove_const_t<Law>, NeoHookeanLnJ> ||
    std::same_as<std::remove_const_t<Law>, NeoHookeanStable>
void each_member(Law& law, const Visit& visit) {
    visit(law.shear_modulus), visit(law.lame_lambda);
}
template <class Law, class Visit>
requires std::same_as<std::remove_const_t<Law>, NeoHookeanIso>
void each_member(Law& law, const Visit& visit) {
    visit(law.shear_modulus), visit(law.bulk_modulus);
}
template <class Law, class Visit>
requires std::same_as<std::remove_const_t<Law>, Polynomial>
void each_member(Law& law, const Visit& visit) {
    visit(law.c10), visit(law.c01), visit(law.c20), visit(law.c11), visit(law.c02), visit(law.c30);
    visit(law.bulk_modulus);
}
template <class Law, class Visit>
requires std::same_as<std::remove_const_t<Law>, ArrudaBoyce>
void each_member(Law& law, const Visit& visit) {
    visit(law.shear_modulus), visit(law.locking_stretch), visit(law.bulk_modulus);
}
template <class Law, class Visit>
requires std::same_as<std::remove_const_t<Law>, Ogden>
void each_member(Law& law, const Visit& visit) {
    for (auto& term : law.terms) visit(term.modulus), visit(term.exponent);
    visit(law.bulk_modulus);
}
template <class Law, class Visit>
requires std::same_as<std::remove_const_t<Law>, TransverselyIsotropic>
void each_member(Law& law, const Visit& visit) {
    visit(law.shear_modulus), visit(law.bulk_modulus), visit(law.fibre_modulus);
    for (int c = 0; c < 3; ++c) visit(law.fibre[c]);
}

template <std::size_t index = 0>
Material law_named(const std::string& name) {
    if constexpr (index == std::variant_size_v<Material>) {
        throw InvalidInput(
            "unknown material law '" + name +
            "'; known are neo_hookean_iso, neo_hookean_lnj, neo_hookean_stable, polynomial, arruda_boyce, "
            "ogden and transversely_isotropic");
    } else {
        const std::variant_alternative_t<index, Material> law;
        return Names()(law) == name ? Material(law) : law_named<index + 1>(name);
    }
}

template <class Law>
double shear_of(const Law& law) {
    return law.shear_modulus;
}
double shear_of(const Polynomial& law) {
    return 2 * (law.c10 + law.c01);
}
// 2 ∂W/∂Ī₁ at Ī₁ = 3.
double shear_of(const ArrudaBoyce& law) {
    const double x = 1 / (law.locking_stretch * law.locking_stretch);
    return law.shear_modulus * (1 + x * (3.0 / 5 + x * (99.0 / 175 + x * (513.0 / 875 + x * 42039.0 / 67375))));
}
double shear_of(const Ogden& law) {
    double sum = 0;
    for (const OgdenTerm& term : law.terms) sum += term.modulus * term.exponent;
    return sum / 2;
}

template <class Law>
double bulk_of(const Law& law) {
    return law.bulk_modulus;
}
double bulk_of(const NeoHookeanLnJ& law) {
    return law.lame_lambda + 2 * law.shear_modulus / 3;
}
double bulk_of(const NeoHookeanStable& law) {
    return law.lame_lambda + 2 * law.shear_modulus / 3;
}

template <class Law>
double volumetric_of(const Law& law) {
    return law.bulk_modulus;
}
double volumetric_of(const NeoHookeanLnJ& law) {
    return law.lame_lambda;
}
double volumetric_of(const NeoHookeanStable& law) {
    return law.lame_lambda + law.shear_modulus / 2;  // λ' − μ'/4
}

template <class Law>
void require_special(const Law& /*law*/, const std::string& /*what*/) {}
void require_special(const ArrudaBoyce& law, const std::string& what) {
    if (!(law.locking_stretch > 1) || !std::isfinite(law.locking_stretch))
        throw InvalidInput("locking stretch of " + what + " is " + std::to_string(law.locking_stretch) +
                           "; it must be greater than 1");
}
void require_special(const Ogden& law, const std::string& what) {
    for (const OgdenTerm& term : law.terms)
        if (term.exponent == 0 || !std::isfinite(term.exponent))
            throw InvalidInput("an Ogden exponent of " + what + " is " + std::to_string(term.exponent) +
                               "; it must be finite and not 0");
}
void require_special(const TransverselyIsotropic& law, const std::string& what) {
    if (!(std::abs(law.fibre.norm() - 1) < 1e-6))
        throw InvalidInput("the fibre direction of " + what + " has length " + std::to_string(law.fibre.norm()) +
                           "; it must be a unit vector");
    if (!(law.fibre_modulus >= 0) || !std::isfinite(law.fibre_modulus))
        throw InvalidInput("the fibre modulus of " + what + " is " + std::to_string(law.fibre_modulus) +
                           " kPa; it must not be negative");
}

void require_positive(double value, const std::string& quantity, const std::string& what) {
    if (!(value > 0) || !std::isfinite(value))
        throw InvalidInput(quantity + " of " + what + " is " + std::to_string(value) +
                           " kPa; it must be positive and finite");
}

}  // namespace

Polynomial mooney_rivlin(double c10_kpa, double c01_kpa, double bulk_modulus_kpa) {
    return {.c10 = c10_kpa, .c01 = c01_kpa, .bulk_modulus = bulk_modulus_kpa};
}

Polynomial yeoh(double c10_kpa, double c20_kpa, double c30_kpa, double bulk_modulus_kpa) {
    return {.c10 = c10_kpa, .c20 = c20_kpa, .c30 = c30_kpa, .bulk_modulus = bulk_modulus_kpa};
}

NeoHookeanIso neo_hookean_iso(double youngs_modulus_kpa, double poisson) {
    const auto [lambda, mu] = lame(youngs_modulus_kpa, poisson);
    return {mu, lambda + 2 * mu / 3};
}

NeoHookeanLnJ neo_hookean_lnj(double youngs_modulus_kpa, double poisson) {
    const auto [lambda, mu] = lame(youngs_modulus_kpa, poisson);
    return {mu, lambda};
}

NeoHookeanStable neo_hookean_stable(double youngs_modulus_kpa, double poisson) {
    const auto [lambda, mu] = lame(youngs_modulus_kpa, poisson);
    return {mu, lambda};
}

void require_valid(const Material& material, const std::string& what) {
    std::visit([&](const auto& law) { require_special(law, what); }, material);
    require_positive(shear_modulus(material), "the shear modulus at rest", what);
    require_positive(bulk_modulus(material), "the bulk modulus at rest", what);
}

std::string law_name(const Material& material) {
    return std::visit(Names(), material);
}

std::vector<double> law_parameters(const Material& material) {
    std::vector<double> result;
    std::visit([&](const auto& law) { each_member(law, [&](double value) { result.push_back(value); }); }, material);
    return result;
}

Material material_of_law(const std::string& name) {
    return law_named(name);
}

Material material_of_law(const std::string& name, const std::vector<double>& parameters) {
    Material material = law_named(name);
    const std::size_t expected = law_parameters(material).size();
    if (parameters.size() != expected)
        throw InvalidInput("material law '" + name + "' takes " + std::to_string(expected) + " parameters, not " +
                           std::to_string(parameters.size()));
    auto next = parameters.begin();
    std::visit([&](auto& law) { each_member(law, [&](double& value) { value = *next++; }); }, material);
    return material;
}

double shear_modulus(const Material& material) {
    return std::visit([](const auto& law) { return shear_of(law); }, material);
}

double volumetric_modulus(const Material& material) {
    return std::visit([](const auto& law) { return volumetric_of(law); }, material);
}

double bulk_modulus(const Material& material) {
    return std::visit([](const auto& law) { return bulk_of(law); }, material);
}

double p_wave_modulus(const Material& material) {
    const double isotropic = bulk_modulus(material) + 4 * shear_modulus(material) / 3;
    // Along the fibre Ī₄ − 1 = 4/3 ε, so W gains η/2 (4/3 ε)².
    if (const auto* fibrous = std::get_if<TransverselyIsotropic>(&material))
        return isotropic + 16 * fibrous->fibre_modulus / 9;
    return isotropic;
}

double poisson_ratio(const Material& material) {
    const double bulk = bulk_modulus(material), shear = shear_modulus(material);
    return (3 * bulk - 2 * shear) / (2 * (3 * bulk + shear));
}

bool admits_inversion(const Material& material) {
    return std::holds_alternative<NeoHookeanStable>(material);
}

}  // namespace tissuewarp::tled
