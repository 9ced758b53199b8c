// The shear stress of every law for a batch of elements, in terms of H = F − I, cof F − I, C − I and J − 1, so that
// float32 keeps small strains. Included once for each instruction set (Highway's convention for -inl files).

// clang-format off
#if defined(TISSUEWARP_CPU_LAWS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef TISSUEWARP_CPU_LAWS_INL
#undef TISSUEWARP_CPU_LAWS_INL
#else
#define TISSUEWARP_CPU_LAWS_INL
#endif
// clang-format on

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "tled/cpu/cpu_strain-inl.hpp"
#include "tled/material.hpp"

HWY_BEFORE_NAMESPACE();
namespace tissuewarp::tled::detail {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// What a law knows beside the strain: its parameters (kernel_parameters.hpp), and the fibre where it has one.
template <class D>
struct Tissue {
    const Scalar<D>* parameter;
    Vec<D> fibre[3];
};

/// a·b of three components.
template <class D>
HWY_INLINE Vec<D> dot(const Vec<D> (&a)[3], const Vec<D> (&b)[3]) {
    return hn::MulAdd(a[0], b[0], hn::MulAdd(a[1], b[1], a[2] * b[2]));
}

/// ln(1 + x) for x > −1, to two units in the last place. For float32 by the polynomial of Moshier's Cephes (logf) for
/// ln(1 + f) on √½ ≤ 1 + f < √2, which divides by nothing.
template <class D>
HWY_INLINE Vec<D> log_1p(D d, Vec<D> x) {
    if constexpr (sizeof(Scalar<D>) == 8) {
        return hn::Log1p(d, x);
    } else {
        constexpr float factors[] = {-1.1514610310e-1F, 1.1676998740e-1F, -1.2420140846e-1F, 1.4249322787e-1F,
                                     -1.6668057665e-1F, 2.0000714765e-1F, -2.4999993993e-1F, 3.3333331174e-1F};
        const hn::RebindToSigned<D> di;
        const auto one = hn::Set(d, 1), y = one + x;
        // y = 2^k (1 + f): the bits above those of √½ count powers of two.
        const auto above = hn::BitCast(di, y) - hn::Set(di, 0x3f3504f3);
        const auto k = hn::ShiftRight<23>(above);
        const auto scaled = hn::BitCast(d, hn::BitCast(di, y) - hn::ShiftLeft<23>(k)) - one;
        const auto power = hn::ConvertTo(d, k);
        const auto f = hn::IfThenElse(power == hn::Zero(d), x, scaled);
        auto series = hn::Set(d, 7.0376836292e-2F);
        for (const float factor : factors) series = hn::MulAdd(series, f, hn::Set(d, factor));
        const auto square = f * f;
        const auto log = hn::MulAdd(square, hn::MulSub(f, series, hn::Set(d, 0.5F)), f);
        return hn::MulAdd(power, hn::Set(d, 0.693147181F), log);
    }
}

/// P of the law's shear part times `volume`, and U'(J). A law of tr C and J says its P as `shear_factors`.
template <class Law>
struct Response;

template <class Law, class D>
concept has_factors = requires(D d, const Strain<D>& strain, const Tissue<D>& tissue, Vec<D> volume) {
    Response<Law>::shear_factors(d, strain, tissue, volume);
};

template <class Law, class D>
HWY_INLINE void shear_stress(D d, const Strain<D>& strain, const Tissue<D>& tissue, Vec<D> volume, Vec<D> (&P)[3][3]) {
    if constexpr (has_factors<Law, D>) {
        const auto factors = Response<Law>::shear_factors(d, strain, tissue, volume);
        stress_of<D>(factors, strain, P);
    } else {
        Response<Law>::shear_stress(d, strain, tissue, volume, P);
    }
}

/// U = (J − 1)²/2.
struct QuadraticVolume {
    template <class D>
    static HWY_INLINE Vec<D> pressure_factor(D, Vec<D> change) {
        return change;
    }
};

template <class D>
HWY_INLINE Vec<D> reciprocal_J(D d, Vec<D> change) {
    const auto one = hn::Set(d, 1);
    return one / (one + change);
}

template <>
struct Response<NeoHookeanLnJ> {
    static constexpr bool admits_inversion = false, has_fibre = false;

    /// P = μ (F − F^−T) = μ/J cof F E
    template <class D>
    static HWY_INLINE StressFactors<D> shear_factors(D d, const Strain<D>& strain, const Tissue<D>& tissue,
                                                     Vec<D> volume) {
        return {volume * hn::Set(d, tissue.parameter[0]) * reciprocal_J(d, strain.change), hn::Zero(d)};
    }
    /// U' = ln J / J
    template <class D>
    static HWY_INLINE Vec<D> pressure_factor(D d, Vec<D> change) {
        return log_1p(d, change) * reciprocal_J(d, change);
    }
};

template <>
struct Response<NeoHookeanStable> : QuadraticVolume {
    static constexpr bool admits_inversion = true, has_fibre = false;

    /// P = μ' (1 − 1/(tr C + 1)) F + μ' (¼ (J − 1) − ¾) cof F; with tr C + 1 = 4 + x the bracket of F is ¾ + x/(4 (4 +
    /// x)), so P = μ' [¾ (F − cof F) + x/(4 (4 + x)) F + ¼ (J − 1) cof F]. As a product with E it would divide by J,
    /// which may be 0 here.
    template <class D>
    static HWY_INLINE void shear_stress(D d, const Strain<D>& strain, const Tissue<D>& tissue, Vec<D> volume,
                                        Vec<D> (&P)[3][3]) {
        const auto one = hn::Set(d, 1), excess = trace_excess(strain);
        const auto mu = volume * hn::Set(d, tissue.parameter[0]);
        const auto three_quarters = mu * hn::Set(d, Scalar<D>(0.75));
        const auto four = hn::Set(d, 4);
        const auto growth = mu * excess / (four * (four + excess));
        const auto quarter_change = mu * hn::Set(d, Scalar<D>(0.25)) * strain.change;
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) {
                const auto F = i == j ? strain.H[i][j] + one : strain.H[i][j];
                const auto cofactor = i == j ? strain.K[i][j] + one : strain.K[i][j];
                P[i][j] = hn::MulAdd(three_quarters, strain.H[i][j] - strain.K[i][j],
                                     hn::MulAdd(growth, F, quarter_change * cofactor));
            }
    }
};

/// J^(−5/3). float32: the bits of a number grow as its logarithm does, so that M − bits/3 are those of an r near
/// J^(−1/3), with h = 1 − J r³ between −0.108 and 0.099; then r⁵ (1 − h)^(−5/3) by a polynomial that interpolates at
/// the Chebyshev points of that range, relative error 1e-8 before rounding.
template <class D>
HWY_INLINE Vec<D> power_of_minus_five_thirds(D d, Vec<D> J) {
    if constexpr (sizeof(Scalar<D>) == 8) {
        // Divided, so that NaN stays NaN; Highway's logarithm makes a number of it.
        return hn::Exp(d, hn::Log(d, J) * hn::Set(d, -2.0 / 3)) / J;
    } else {
        constexpr float factors[] = {3.671276404F, 3.170046715F, 2.715631885F, 2.222217177F, 1.666667213F, 1.0F};
        const hn::RebindToSigned<D> di;
        const auto bits = hn::ConvertTo(d, hn::BitCast(di, J));
        const auto r =
            hn::BitCast(d, hn::ConvertTo(di, hn::NegMulAdd(bits, hn::Set(d, 1.0F / 3), hn::Set(d, 1419920000.0F))));
        const auto square = r * r;
        const auto h = hn::NegMulAdd(J * r, square, hn::Set(d, 1));
        auto series = hn::Set(d, 3.942550970F);
        for (const float factor : factors) series = hn::MulAdd(series, h, hn::Set(d, factor));
        return square * square * (r * series);
    }
}

/// ln J^(−1/3) and the powers that isochoric laws take of it.
template <class D>
HWY_INLINE Vec<D> isochoric_exponent(D d, const Strain<D>& strain) {
    return log_1p(d, strain.change) * hn::Set(d, Scalar<D>(-1.0 / 3));
}

/// 2 ψ₁ J^(−2/3) (F − I₁/3 F^−T) = 2 ψ₁ J^(−5/3) cof F (E − (tr E)/3 I).
template <class D>
HWY_INLINE StressFactors<D> first_invariant_factors(D d, Vec<D> excess, Vec<D> scale) {
    return {scale, scale * excess * hn::Set(d, Scalar<D>(-1.0 / 3))};
}

template <>
struct Response<NeoHookeanIso> : QuadraticVolume {
    static constexpr bool admits_inversion = false, has_fibre = false;

    /// ψ₁ = μ/2
    template <class D>
    static HWY_INLINE StressFactors<D> shear_factors(D d, const Strain<D>& strain, const Tissue<D>& tissue,
                                                     Vec<D> volume) {
        const auto scale =
            volume * hn::Set(d, tissue.parameter[0]) * power_of_minus_five_thirds(d, hn::Set(d, 1) + strain.change);
        return first_invariant_factors(d, trace_excess(strain), scale);
    }
};

template <>
struct Response<ArrudaBoyce> {
    static constexpr bool admits_inversion = false, has_fibre = false;

    /// ψ₁ = Σ k_i Ī₁^(i−1)
    template <class D>
    static HWY_INLINE StressFactors<D> shear_factors(D d, const Strain<D>& strain, const Tissue<D>& tissue,
                                                     Vec<D> volume) {
        const auto excess = trace_excess(strain);
        const auto exponent = isochoric_exponent(d, strain);
        const auto j = hn::Exp(d, exponent + exponent);
        const auto invariant = j * (excess + hn::Set(d, 3));
        auto psi = hn::Set(d, tissue.parameter[4]);
        for (int i = 3; i >= 0; --i) psi = hn::MulAdd(psi, invariant, hn::Set(d, tissue.parameter[i]));
        const auto scale = volume * (psi + psi) * j * reciprocal_J(d, strain.change);
        return first_invariant_factors(d, excess, scale);
    }
    /// U' = (J − 1/J)/2 = x (2 + x)/(2 (1 + x)) with x = J − 1
    template <class D>
    static HWY_INLINE Vec<D> pressure_factor(D d, Vec<D> change) {
        const auto one = hn::Set(d, 1), J = one + change;
        return change * (one + J) / (J + J);
    }
};

template <>
struct Response<Polynomial> : QuadraticVolume {
    static constexpr bool admits_inversion = false, has_fibre = false;

    /// P = 2 ψ₁ J^(−2/3) (F − I₁/3 G) + 2 ψ₂ J^(−4/3) (I₁ F − F C − 2/3 I₂ G), G = F^−T. With C = I + E, t = tr E and
    /// q = 4/3 t + (t² − E:E)/3 the second bracket is 2 (F − G) + F (t I − E) − q G = G (2 E − q I) + F (t I − E).
    template <class D>
    static void shear_stress(D d, const Strain<D>& strain, const Tissue<D>& tissue, Vec<D> volume, Vec<D> (&P)[3][3]) {
        const auto set = [&](double value) { return hn::Set(d, Scalar<D>(value)); };
        const auto& E = strain.E;
        const auto t = trace_excess(strain);
        auto E_E = E[0][0] * E[0][0];
        for (int k = 1; k < 9; ++k) E_E = hn::MulAdd(E[k / 3][k % 3], E[k / 3][k % 3], E_E);
        const auto minors = t * t - E_E;
        const auto exponent = isochoric_exponent(d, strain);
        const auto j = hn::Exp(d, exponent + exponent), three = set(3);
        const auto x = hn::MulSub(j, three + t, three);
        const auto y = hn::MulSub(j * j, hn::MulAdd(set(0.5), minors, three + t + t), three);
        const auto c = [&](int k) { return hn::Set(d, tissue.parameter[k]); };  // c10 c01 c20 c11 c02 c30
        const auto psi_1 = c(0) + hn::MulAdd(c(3), y, x * hn::MulAdd(three * c(5), x, c(2) + c(2)));
        const auto psi_2 = c(1) + hn::MulAdd(c(3), x, (c(4) + c(4)) * y);

        const auto inverse_J = reciprocal_J(d, strain.change), two_volume = volume + volume;
        const auto scale = two_volume * psi_2 * j * j, over_J = scale * inverse_J;
        const auto q = hn::MulAdd(set(4.0 / 3), t, set(1.0 / 3) * minors);
        auto factors = first_invariant_factors(d, t, two_volume * psi_1 * j * inverse_J);
        factors.of_E = factors.of_E + over_J + over_J;
        factors.of_I = hn::NegMulAdd(over_J, q, factors.of_I);
        stress_of<D>(factors, strain, P);
        for (int i = 0; i < 3; ++i)
            for (int k = 0; k < 3; ++k) {
                auto bracket = hn::MulSub(t, strain.H[i][k], E[i][k]);  // F (t I − E)
                for (int m = 0; m < 3; ++m) bracket = hn::NegMulAdd(strain.H[i][m], E[m][k], bracket);
                if (i == k) bracket = bracket + t;
                P[i][k] = hn::MulAdd(scale, bracket, P[i][k]);
            }
    }
};

template <>
struct Response<TransverselyIsotropic> : QuadraticVolume {
    static constexpr bool admits_inversion = false, has_fibre = true;

    /// P of the isochoric neo-Hookean law and 2 η (Ī₄ − 1) j (f aᵀ − I₄/3 G) with f = F a, j = J^(−2/3) and G = cof
    /// F/J. Ī₄ − 1 = (j − 1) I₄ + (I₄ − 1), where j − 1 = (j³ − 1)/(1 + j + j²) and j³ = J⁻².
    template <class D>
    static HWY_INLINE FibreStressFactors<D> shear_factors(D d, const Strain<D>& strain, const Tissue<D>& tissue,
                                                          Vec<D> volume) {
        const auto one = hn::Set(d, 1), J = one + strain.change;
        const auto power = power_of_minus_five_thirds(d, J), j = J * power;
        FibreStressFactors<D> factors;
        static_cast<StressFactors<D>&>(factors) =
            first_invariant_factors(d, trace_excess(strain), volume * hn::Set(d, tissue.parameter[0]) * power);
        Vec<D> stretch[3];  // H a
        for (int i = 0; i < 3; ++i) {
            stretch[i] = dot<D>(strain.H[i], tissue.fibre);
            factors.fibre[i] = tissue.fibre[i];
            factors.stretched[i] = tissue.fibre[i] + stretch[i];
        }
        const auto along = dot<D>(tissue.fibre, stretch);
        const auto excess = along + along + dot<D>(stretch, stretch);  // I₄ − 1 for a unit vector
        const auto I4 = one + excess, sum = hn::MulAdd(j, one + j, one);
        const auto inverse = one / (J * J * sum);
        const auto j_lack = strain.change * (one + J) * inverse;  // 1 − j
        const auto strength = hn::NegMulAdd(j_lack, I4, excess);
        factors.of_fibre = volume * hn::Set(d, tissue.parameter[1]) * (strength + strength) * j;
        const auto third = I4 * (inverse * J * sum) * hn::Set(d, Scalar<D>(1.0 / 3));
        factors.of_I = hn::NegMulAdd(factors.of_fibre, third, factors.of_I);
        return factors;
    }
};

/// Eigenvalues on the diagonal of A and eigenvectors in the columns of n, by cyclic Jacobi rotations (Golub and Van
/// Loan, Matrix Computations, section 8.5): exact for repeated eigenvalues and relative to the smallest, where formulas
/// with roots of the characteristic polynomial are not. Four sweeps take any matrix to rounding in float64.
template <class D>
void symmetric_eigenvectors(D d, Vec<D> (&A)[3][3], Vec<D> (&n)[3][3]) {
    constexpr int sweeps = 4;
    const auto zero = hn::Zero(d), one = hn::Set(d, 1);
    const auto tiny = hn::Set(d, sizeof(Scalar<D>) == 4 ? Scalar<D>(1e-37) : Scalar<D>(1e-300));
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) n[i][j] = i == j ? one : zero;
    for (int rotation = 0; rotation < 3 * sweeps; ++rotation) {
        const int p = rotation % 3 == 2 ? 1 : 0, q = rotation % 3 == 0 ? 1 : 2, r = 3 - p - q;
        const auto gap = A[q][q] - A[p][p], twice = A[p][q] + A[p][q];
        const auto root = hn::Sqrt(hn::MulAdd(gap, gap, twice * twice));
        const auto t = twice / (gap + hn::CopySign(root + tiny, gap));  // tan of the rotation that clears A_pq
        const auto c = one / hn::Sqrt(hn::MulAdd(t, t, one)), s = t * c;
        A[p][p] = hn::NegMulAdd(t, A[p][q], A[p][p]);
        A[q][q] = hn::MulAdd(t, A[p][q], A[q][q]);
        A[p][q] = A[q][p] = zero;
        const auto rp = A[r][p], rq = A[r][q];
        A[r][p] = A[p][r] = hn::MulSub(c, rp, s * rq);
        A[r][q] = A[q][r] = hn::MulAdd(s, rp, c * rq);
        for (int i = 0; i < 3; ++i) {
            const auto np = n[i][p], nq = n[i][q];
            n[i][p] = hn::MulSub(c, np, s * nq);
            n[i][q] = hn::MulAdd(s, np, c * nq);
        }
    }
}

template <>
struct Response<Ogden> : QuadraticVolume {
    static constexpr bool admits_inversion = false, has_fibre = false;

    /// S = Σ T_i/c_i n_i n_iᵀ with T_i = Σ_p μ_p (y_i − ȳ) and y_i = λ̄_i^α_p − 1; P = F S.
    template <class D>
    static void shear_stress(D d, const Strain<D>& strain, const Tissue<D>& tissue, Vec<D> volume, Vec<D> (&P)[3][3]) {
        Vec<D> E[3][3], n[3][3];
        for (int i = 0; i < 9; ++i) E[i / 3][i % 3] = strain.E[i / 3][i % 3];
        symmetric_eigenvectors(d, E, n);
        const auto exponent = isochoric_exponent(d, strain);
        const auto half = hn::Set(d, Scalar<D>(0.5)), third = hn::Set(d, Scalar<D>(1.0 / 3)), one = hn::Set(d, 1);
        Vec<D> log_stretch[3], T[3] = {hn::Zero(d), hn::Zero(d), hn::Zero(d)};  // ln λ̄_i
        for (int i = 0; i < 3; ++i) log_stretch[i] = hn::MulAdd(half, log_1p(d, E[i][i]), exponent);
        for (int term = 0; term < 3; ++term) {
            if (tissue.parameter[2 * term] == Scalar<D>(0)) continue;
            const auto modulus = hn::Set(d, tissue.parameter[2 * term]);
            const auto alpha = hn::Set(d, tissue.parameter[2 * term + 1]);
            Vec<D> y[3];
            for (int i = 0; i < 3; ++i) y[i] = hn::Expm1(d, alpha * log_stretch[i]);
            const auto mean = third * (y[0] + y[1] + y[2]);
            for (int i = 0; i < 3; ++i) T[i] = hn::MulAdd(modulus, y[i] - mean, T[i]);
        }
        Vec<D> S[3][3];
        for (int i = 0; i < 3; ++i) T[i] = volume * T[i] / (one + E[i][i]);
        for (int i = 0; i < 3; ++i)
            for (int k = i; k < 3; ++k)
                S[i][k] = S[k][i] =
                    hn::MulAdd(T[0] * n[i][0], n[k][0], hn::MulAdd(T[1] * n[i][1], n[k][1], T[2] * n[i][2] * n[k][2]));
        for (int i = 0; i < 3; ++i)
            for (int k = 0; k < 3; ++k) P[i][k] = S[i][k] + dot<D>(strain.H[i], S[k]);
    }
};

}  // namespace HWY_NAMESPACE
}  // namespace tissuewarp::tled::detail
HWY_AFTER_NAMESPACE();

#endif  // TISSUEWARP_CPU_LAWS_INL
