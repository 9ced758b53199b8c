#include "tled/viscosity.hpp"

#include "core/errors.hpp"

#include <cmath>

namespace tissuewarp::tled {

namespace {

/// Every Ψ is linear in its moduli, so scaling them scales the stress; U and M must stay.
struct ScaledShear {
    double factor;

    Material operator()(NeoHookeanIso law) const {
        law.shear_modulus *= factor;
        return law;
    }
    Material operator()(NeoHookeanLnJ law) const {
        law.shear_modulus *= factor;
        return law;
    }
    Material operator()(NeoHookeanStable law) const {
        const double volumetric = volumetric_modulus(law);  // λ + μ/2
        law.shear_modulus *= factor;
        law.lame_lambda = volumetric - law.shear_modulus / 2;
        return law;
    }
    Material operator()(Polynomial law) const {
        for (double* modulus : {&law.c10, &law.c01, &law.c20, &law.c11, &law.c02, &law.c30}) *modulus *= factor;
        return law;
    }
    Material operator()(ArrudaBoyce law) const {
        law.shear_modulus *= factor;
        return law;
    }
    Material operator()(Ogden law) const {
        for (OgdenTerm& term : law.terms) term.modulus *= factor;
        return law;
    }
    Material operator()(TransverselyIsotropic law) const {
        law.shear_modulus *= factor;
        law.fibre_modulus *= factor;
        return law;
    }
};

}  // namespace

void require_valid(const PronySeries& series, const std::string& what) {
    for (const PronyTerm& term : series.terms) {
        if (!(term.relative_modulus > 0) || !std::isfinite(term.relative_modulus))
            throw InvalidInput("a relative modulus of " + what + " is " + std::to_string(term.relative_modulus) +
                               "; it must be positive");
        if (!(term.relaxation_time > 0) || !std::isfinite(term.relaxation_time))
            throw InvalidInput("a relaxation time of " + what + " is " + std::to_string(term.relaxation_time) +
                               " s; it must be positive");
    }
    if (!(relaxed_fraction(series) > 0))
        throw InvalidInput("the relative moduli of " + what + " leave " + std::to_string(relaxed_fraction(series)) +
                           " of the stiffness; their sum must be below 1");
}

double relaxed_fraction(const PronySeries& series) {
    double fraction = 1;
    for (const PronyTerm& term : series.terms) fraction -= term.relative_modulus;
    return fraction;
}

Material with_shear_scaled(const Material& material, double factor) {
    return std::visit(ScaledShear{factor}, material);
}

}  // namespace tissuewarp::tled
