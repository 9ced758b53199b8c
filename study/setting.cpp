#include "study/setting.hpp"

#include "core/errors.hpp"

#include <cstdio>
#include <stdexcept>

namespace tissuewarp::study {

namespace {

constexpr double youngs_modulus_kpa = 3.0;

/// The value of a list that has this name.
template <class Values, class Value = typename Values::value_type>
Value named(const std::string& name, const Values& values, const char* what) {
    std::string all;
    for (const Value value : values) {
        if (name_of(value) == name) return value;
        all += (all.empty() ? "" : ", ") + name_of(value);
    }
    throw InvalidInput("'" + name + "' is no " + what + "; there are " + all);
}

std::string number(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%g", value);
    return text;
}

}  // namespace

std::string name_of(tled::Element element) {
    return element == tled::Element::T4 ? "T4" : "averaged pressure";
}

std::string name_of(Law law) {
    constexpr const char* names[] = {"linear", "ln J", "iso", "stable", "Mooney-Rivlin", "Ogden"};
    return names[static_cast<int>(law)];
}

std::string name_of(Solver solver) {
    constexpr const char* names[] = {"automatic", "L-BFGS", "dynamic relaxation", "self-checked relaxation", "Newton"};
    return names[static_cast<int>(solver)];
}

std::string name_of(Hold hold) {
    return hold == Hold::Hard ? "hard" : "soft";
}

std::string name_of(tled::Scalar scalar) {
    return scalar == tled::Scalar::Float32 ? "float32" : "float64";
}

std::string name_of(tled::Processor processor) {
    return processor == tled::Processor::Cpu ? "CPU" : "GPU";
}

tled::Element element_named(const std::string& name) {
    return named(name, every_element, "element");
}
Law law_named(const std::string& name) {
    return named(name, every_law, "law");
}
Solver solver_named(const std::string& name) {
    return named(name, every_solver, "solver");
}
Hold hold_named(const std::string& name) {
    return named(name, std::array{Hold::Hard, Hold::Soft}, "way to hold tissue");
}
tled::Scalar scalar_named(const std::string& name) {
    return named(name, std::array{tled::Scalar::Float32, tled::Scalar::Float64}, "arithmetic");
}
tled::Processor processor_named(const std::string& name) {
    return named(name, std::array{tled::Processor::Cpu, tled::Processor::Gpu}, "processor");
}

tled::Material material_of(const Physics& physics) {
    const tled::NeoHookeanIso iso = tled::neo_hookean_iso(youngs_modulus_kpa, physics.poissons_ratio);
    switch (physics.law) {
        case Law::Linear:
        case Law::LnJ:
            break;
        case Law::Iso:
            return iso;
        case Law::Stable:
            return tled::neo_hookean_stable(youngs_modulus_kpa, physics.poissons_ratio);
        case Law::MooneyRivlin:  // μ = 2 (c10 + c01)
            return tled::mooney_rivlin(iso.shear_modulus / 4, iso.shear_modulus / 4, iso.bulk_modulus);
        case Law::Ogden: {  // μ = ½ Σ μ_p α_p
            constexpr double exponent = -4.7;
            tled::Ogden ogden;
            ogden.terms[0] = {2 * iso.shear_modulus / exponent, exponent};
            ogden.bulk_modulus = iso.bulk_modulus;
            return ogden;
        }
    }
    return tled::neo_hookean_lnj(youngs_modulus_kpa, physics.poissons_ratio);
}

tled::EquilibriumMethod method_of(Solver solver) {
    switch (solver) {
        case Solver::Automatic:
            return tled::EquilibriumMethod::Automatic;
        case Solver::Lbfgs:
            return tled::EquilibriumMethod::Lbfgs;
        case Solver::DynamicRelaxation:
            return tled::EquilibriumMethod::DynamicRelaxation;
        case Solver::SelfCheckedRelaxation:
            return tled::EquilibriumMethod::SelfCheckedRelaxation;
        case Solver::Newton:
            break;
    }
    throw std::logic_error("Newton's method is not one of tled::equilibrium");
}

std::string words_of(const Setting& setting) {
    return std::to_string(setting.elements) + " " + name_of(setting.element) + ", " + name_of(setting.physics.law) +
           ", ν " + number(setting.physics.poissons_ratio) + ", " + name_of(setting.solver) + ", " +
           number(setting.tolerance_mm) + " mm, " + name_of(setting.arithmetic) + ", " + name_of(setting.processor) +
           ", " + name_of(setting.physics.hold);
}

}  // namespace tissuewarp::study
