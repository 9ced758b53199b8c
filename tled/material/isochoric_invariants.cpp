// Laws of the isochoric invariants Ī₁, Ī₂ and Ī₄ (Holzapfel, Nonlinear Solid Mechanics, 2000, sections 6.4 and 6.7).

#include <Eigen/LU>

#include <array>
#include <cmath>

#include "tled/material/laws.hpp"

namespace tissuewarp::tled::detail {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

/// Ψ(Ī₁, Ī₂) and its derivatives.
struct InvariantFunction {
    double energy = 0, d1 = 0, d2 = 0, d11 = 0, d12 = 0, d22 = 0;
};

InvariantFunction function_of(const NeoHookeanIso& law, double first, double /*second*/) {
    return {.energy = 0.5 * law.shear_modulus * (first - 3.0), .d1 = 0.5 * law.shear_modulus};
}

InvariantFunction function_of(const TransverselyIsotropic& law, double first, double second) {
    return function_of(NeoHookeanIso{law.shear_modulus, law.bulk_modulus}, first, second);
}

InvariantFunction function_of(const Polynomial& law, double first, double second) {
    const double x = first - 3.0, y = second - 3.0;
    return {
        .energy = law.c10 * x + law.c01 * y + law.c20 * x * x + law.c11 * x * y + law.c02 * y * y + law.c30 * x * x * x,
        .d1 = law.c10 + 2 * law.c20 * x + law.c11 * y + 3 * law.c30 * x * x,
        .d2 = law.c01 + law.c11 * x + 2 * law.c02 * y,
        .d11 = 2 * law.c20 + 6 * law.c30 * x,
        .d12 = law.c11,
        .d22 = 2 * law.c02};
}

InvariantFunction function_of(const ArrudaBoyce& law, double first, double /*second*/) {
    const std::array<double, 5> factor = arruda_boyce_factors(law.locking_stretch);
    InvariantFunction result;
    double power = 1.0, rest_power = 1.0;  // Ī₁^(i−1), 3^(i−1)
    for (int i = 1; i <= 5; ++i, power *= first, rest_power *= 3.0) {
        const double k = law.shear_modulus * factor[static_cast<std::size_t>(i - 1)];
        result.energy += k / i * (power * first - rest_power * 3.0);
        result.d1 += k * power;
        result.d11 += k * (i - 1) * power / first;
    }
    return result;
}

/// Ī₁ and Ī₂ at F with their derivatives D = ∂Ī/∂F:
/// D₁ = 2 J^(−2/3) (F − I₁/3 G), D₂ = 2 J^(−4/3) (I₁ F − F C − 2/3 I₂ G), G = F⁻ᵀ.
struct Invariants {
    Matrix3d F, C, G;
    double j, I1, I2;  // j = J^(−2/3); I1, I2 of C
    Matrix3d D1, D2;

    explicit Invariants(const Matrix3d& gradient)
        : F(gradient),
          C(F.transpose() * F),
          G(F.inverse().transpose()),
          j(std::pow(F.determinant(), -2.0 / 3.0)),
          I1(C.trace()),
          I2(0.5 * (I1 * I1 - C.squaredNorm())),
          D1(2 * j * (F - I1 / 3 * G)),
          D2(2 * j * j * (I1 * F - F * C - 2.0 / 3.0 * I2 * G)) {}
    [[nodiscard]] double first() const { return j * I1; }
    [[nodiscard]] double second() const { return j * j * I2; }

    /// dD₁ and dD₂ for dF.
    [[nodiscard]] std::pair<Matrix3d, Matrix3d> derivative(const Matrix3d& dF) const {
        const double dj_j = -2.0 / 3.0 * contract(G, dF);  // dj/j
        const Matrix3d dG = -G * dF.transpose() * G, dC = dF.transpose() * F + F.transpose() * dF;
        const double dI1 = 2 * contract(F, dF), dI2 = 2 * contract(I1 * F - F * C, dF);
        return {dj_j * D1 + 2 * j * (dF - dI1 / 3 * G - I1 / 3 * dG),
                2 * dj_j * D2 +
                    2 * j * j * (dI1 * F + I1 * dF - dF * C - F * dC - 2.0 / 3.0 * dI2 * G - 2.0 / 3.0 * I2 * dG)};
    }
};

template <class Law>
double isotropic_energy(const Law& law, const Matrix3d& F) {
    const Invariants at(F);
    return function_of(law, at.first(), at.second()).energy;
}

template <class Law>
Matrix3d isotropic_stress(const Law& law, const Matrix3d& F) {
    const Invariants at(F);
    const InvariantFunction psi = function_of(law, at.first(), at.second());
    return psi.d1 * at.D1 + psi.d2 * at.D2;
}

template <class Law>
Matrix3d isotropic_derivative(const Law& law, const Matrix3d& F, const Matrix3d& dF) {
    const Invariants at(F);
    const InvariantFunction psi = function_of(law, at.first(), at.second());
    const double first = contract(at.D1, dF), second = contract(at.D2, dF);
    const auto [dD1, dD2] = at.derivative(dF);
    return (psi.d11 * first + psi.d12 * second) * at.D1 + psi.d1 * dD1 + (psi.d12 * first + psi.d22 * second) * at.D2 +
           psi.d2 * dD2;
}

/// Ī₄ − 1 and D₄ = ∂Ī₄/∂F = 2 J^(−2/3) (f aᵀ − I₄/3 G), f = F a.
struct FibreStretch {
    Matrix3d G;
    Vector3d a, f;
    double j, I4;
    Matrix3d D4;

    FibreStretch(const Matrix3d& F, const Vector3d& fibre)
        : G(F.inverse().transpose()),
          a(fibre),
          f(F * fibre),
          j(std::pow(F.determinant(), -2.0 / 3.0)),
          I4(f.squaredNorm()),
          D4(2 * j * (f * a.transpose() - I4 / 3 * G)) {}
    [[nodiscard]] double excess() const { return j * I4 - 1.0; }
    [[nodiscard]] Matrix3d derivative(const Matrix3d& dF) const {
        const Vector3d df = dF * a;
        const Matrix3d dG = -G * dF.transpose() * G;
        return -2.0 / 3.0 * contract(G, dF) * D4 +
               2 * j * (df * a.transpose() - 2.0 / 3.0 * f.dot(df) * G - I4 / 3 * dG);
    }
};

}  // namespace

std::array<double, 5> arruda_boyce_factors(double locking_stretch) {
    const double x = 1 / (locking_stretch * locking_stretch);
    constexpr std::array<double, 5> C{1.0 / 2, 1.0 / 20, 11.0 / 1050, 19.0 / 7000, 519.0 / 673750};
    std::array<double, 5> result{};
    double power = 1.0;
    for (std::size_t i = 0; i < 5; ++i, power *= x) result[i] = static_cast<double>(i + 1) * C[i] * power;
    return result;
}

double shear_energy_of(const NeoHookeanIso& law, const Matrix3d& F) {
    return isotropic_energy(law, F);
}
Matrix3d shear_stress_of(const NeoHookeanIso& law, const Matrix3d& F) {
    return isotropic_stress(law, F);
}
Matrix3d shear_derivative_of(const NeoHookeanIso& law, const Matrix3d& F, const Matrix3d& dF) {
    return isotropic_derivative(law, F, dF);
}

double shear_energy_of(const Polynomial& law, const Matrix3d& F) {
    return isotropic_energy(law, F);
}
Matrix3d shear_stress_of(const Polynomial& law, const Matrix3d& F) {
    return isotropic_stress(law, F);
}
Matrix3d shear_derivative_of(const Polynomial& law, const Matrix3d& F, const Matrix3d& dF) {
    return isotropic_derivative(law, F, dF);
}

double shear_energy_of(const ArrudaBoyce& law, const Matrix3d& F) {
    return isotropic_energy(law, F);
}
Matrix3d shear_stress_of(const ArrudaBoyce& law, const Matrix3d& F) {
    return isotropic_stress(law, F);
}
Matrix3d shear_derivative_of(const ArrudaBoyce& law, const Matrix3d& F, const Matrix3d& dF) {
    return isotropic_derivative(law, F, dF);
}

// W gains η/2 (Ī₄ − 1)², so P gains η (Ī₄ − 1) D₄.
double shear_energy_of(const TransverselyIsotropic& law, const Matrix3d& F) {
    const double excess = FibreStretch(F, law.fibre).excess();
    return isotropic_energy(law, F) + 0.5 * law.fibre_modulus * excess * excess;
}
Matrix3d shear_stress_of(const TransverselyIsotropic& law, const Matrix3d& F) {
    const FibreStretch fibre(F, law.fibre);
    return isotropic_stress(law, F) + law.fibre_modulus * fibre.excess() * fibre.D4;
}
Matrix3d shear_derivative_of(const TransverselyIsotropic& law, const Matrix3d& F, const Matrix3d& dF) {
    const FibreStretch fibre(F, law.fibre);
    return isotropic_derivative(law, F, dF) +
           law.fibre_modulus * (contract(fibre.D4, dF) * fibre.D4 + fibre.excess() * fibre.derivative(dF));
}

}  // namespace tissuewarp::tled::detail
