#include "tled/material/kernel_parameters.hpp"

#include "tled/material/laws.hpp"

namespace tissuewarp::tled::detail {

namespace {

struct Parameters {
    KernelParameters operator()(const NeoHookeanIso& law) const { return {law.shear_modulus}; }
    KernelParameters operator()(const NeoHookeanLnJ& law) const { return {law.shear_modulus}; }
    KernelParameters operator()(const NeoHookeanStable& law) const { return {4 * law.shear_modulus / 3}; }
    KernelParameters operator()(const Polynomial& law) const {
        return {law.c10, law.c01, law.c20, law.c11, law.c02, law.c30};
    }
    KernelParameters operator()(const ArrudaBoyce& law) const {
        KernelParameters result{};
        const std::array<double, 5> factors = arruda_boyce_factors(law.locking_stretch);
        for (std::size_t i = 0; i < factors.size(); ++i) result[i] = law.shear_modulus * factors[i];
        return result;
    }
    KernelParameters operator()(const Ogden& law) const {
        const auto& [a, b, c] = law.terms;
        return {a.modulus, a.exponent, b.modulus, b.exponent, c.modulus, c.exponent};
    }
    KernelParameters operator()(const TransverselyIsotropic& law) const {
        return {law.shear_modulus, law.fibre_modulus};
    }
};

}  // namespace

KernelParameters kernel_parameters(const Material& material) {
    return std::visit(Parameters(), material);
}

}  // namespace tissuewarp::tled::detail
