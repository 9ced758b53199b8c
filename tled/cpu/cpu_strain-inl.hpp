// The strain of a batch of elements from the displacement gradient, and the stress that most laws make of it. Included
// once for each instruction set (Highway's convention for -inl files).

// clang-format off
#if defined(TISSUEWARP_CPU_STRAIN_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef TISSUEWARP_CPU_STRAIN_INL
#undef TISSUEWARP_CPU_STRAIN_INL
#else
#define TISSUEWARP_CPU_STRAIN_INL
#endif
// clang-format on

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tissuewarp::tled::detail {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

template <class D>
using Vec = hn::Vec<D>;
template <class D>
using Scalar = hn::TFromD<D>;

/// Kinematics of a batch of elements, without the units whose place their small numbers would fall below.
template <class D>
struct Strain {
    Vec<D> H[3][3];  // F − I
    Vec<D> K[3][3];  // cof F − I
    Vec<D> E[3][3];  // C − I, symmetric
    Vec<D> change;   // J − 1
};

/// Fills all that follows from H, with i, j, k all different: (cof F)_ij = H_jk H_ki − H_ji F_kk,
/// (cof F)_ii − 1 = H_jj + F_jj H_kk − H_jk H_kj, J − 1 = H_00 + F_00 K_00 + H_01 K_01 + H_02 K_02 (first row of F),
/// E_ij = F_ii H_ij + F_jj H_ji + H_ki H_kj and E_ii = H_ii + F_ii H_ii + H_ji² + H_ki².
template <class D>
HWY_INLINE void finish_strain(D d, Strain<D>& strain) {
    const auto& H = strain.H;
    auto &K = strain.K, &E = strain.E;
    Vec<D> F[3];  // the diagonal
    for (int i = 0; i < 3; ++i) F[i] = hn::Set(d, 1) + H[i][i];
    for (int i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        K[i][i] = hn::NegMulAdd(H[j][k], H[k][j], hn::MulAdd(F[j], H[k][k], H[j][j]));
        K[i][j] = hn::NegMulAdd(H[j][i], F[k], H[j][k] * H[k][i]);
        K[j][i] = hn::NegMulAdd(H[i][j], F[k], H[i][k] * H[k][j]);
        E[i][i] = hn::MulAdd(H[j][i], H[j][i], hn::MulAdd(H[k][i], H[k][i], hn::MulAdd(F[i], H[i][i], H[i][i])));
        E[i][j] = E[j][i] = hn::MulAdd(F[i], H[i][j], hn::MulAdd(F[j], H[j][i], H[k][i] * H[k][j]));
    }
    strain.change = hn::MulAdd(F[0], K[0][0], hn::MulAdd(H[0][1], K[0][1], hn::MulAdd(H[0][2], K[0][2], H[0][0])));
}

/// cof F.
template <class D>
HWY_INLINE Vec<D> cof(D d, const Strain<D>& strain, int i, int j) {
    return i == j ? hn::Set(d, 1) + strain.K[i][i] : strain.K[i][j];
}

/// tr C − 3.
template <class D>
HWY_INLINE Vec<D> trace_excess(const Strain<D>& strain) {
    return strain.E[0][0] + strain.E[1][1] + strain.E[2][2];
}

/// First Piola–Kirchhoff stress of a law of tr C and J, as most are: cof F (of_E E + of_I I). It is that of
/// of_E (J F − cof F) + of_I cof F, because F − F⁻ᵀ = F⁻ᵀ (FᵀF − I) and cof F = J F⁻ᵀ.
template <class D>
struct StressFactors {
    Vec<D> of_E, of_I;
};

/// In a turned body the terms of F − F⁻ᵀ are of the order of 1 and cancel, and what rounding leaves of them has moments
/// that turn it faster or slower (docs/decisions/gpu_arithmetic.md). E is small and symmetric from the start.
template <class D>
HWY_INLINE void stress_of(const StressFactors<D>& f, const Strain<D>& strain, Vec<D> (&P)[3][3]) {
    Vec<D> S[3][3];
    for (int i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3;
        S[i][i] = hn::MulAdd(f.of_E, strain.E[i][i], f.of_I);
        S[i][j] = S[j][i] = f.of_E * strain.E[i][j];
    }
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            P[i][j] = S[i][j];
            for (int k = 0; k < 3; ++k) P[i][j] = hn::MulAdd(strain.K[i][k], S[k][j], P[i][j]);
        }
}

/// Those of a law with fibres a: of_fibre f aᵀ with f = F a comes to the others.
template <class D>
struct FibreStressFactors : StressFactors<D> {
    Vec<D> of_fibre, fibre[3], stretched[3];  // a, f
};

template <class D>
HWY_INLINE void stress_of(const FibreStressFactors<D>& f, const Strain<D>& strain, Vec<D> (&P)[3][3]) {
    stress_of<D>(static_cast<const StressFactors<D>&>(f), strain, P);
    for (int i = 0; i < 3; ++i) {
        const auto scaled = f.of_fibre * f.stretched[i];
        for (int j = 0; j < 3; ++j) P[i][j] = hn::MulAdd(scaled, f.fibre[j], P[i][j]);
    }
}

/// A symmetric second Piola–Kirchhoff stress: 11 22 33 12 23 31.
template <class D>
struct SecondStress {
    Vec<D> S[6];
};

/// F⁻¹ P of the same factors, and what a pressure p adds to it: p cof C / J. With A = cof C, C A = J² I gives A E =
/// J² I − A, so S = (of_E (J² I − A) + of_I A)/J. A = (1 + tr E) I − B with B = E − cof E keeps small strains.
template <class D>
class SecondStressOf {
public:
    HWY_INLINE SecondStressOf(D d, const Strain<D>& strain) {
        const auto& E = strain.E;
        for (int i = 0; i < 3; ++i) {
            const int j = (i + 1) % 3, k = (i + 2) % 3;
            B_[i] = E[i][i] - hn::NegMulAdd(E[j][k], E[j][k], E[j][j] * E[k][k]);
            B_[3 + i] = hn::NegMulAdd(E[k][i], E[k][j], hn::MulAdd(E[i][j], E[k][k], E[i][j]));
        }
        trace_ = trace_excess(strain);
        one_and_trace_ = hn::Set(d, 1) + trace_;
        change_of_square_ = strain.change * (hn::Set(d, 2) + strain.change);  // J² − 1
        inverse_J_ = hn::Set(d, 1) / (hn::Set(d, 1) + strain.change);
    }

    HWY_INLINE SecondStress<D> shear(const StressFactors<D>& f) const {
        const auto of_E = f.of_E * inverse_J_, of_I = f.of_I * inverse_J_;
        return combined(of_E - of_I, hn::MulAdd(of_E, change_of_square_ - trace_, of_I * one_and_trace_));
    }
    HWY_INLINE SecondStress<D> shear(const FibreStressFactors<D>& f) const {
        SecondStress<D> s = shear(static_cast<const StressFactors<D>&>(f));
        for (int i = 0; i < 3; ++i) {
            const auto scaled = f.of_fibre * f.fibre[i];
            s.S[i] = hn::MulAdd(scaled, f.fibre[i], s.S[i]);
            s.S[3 + i] = hn::MulAdd(scaled, f.fibre[(i + 1) % 3], s.S[3 + i]);
        }
        return s;
    }
    HWY_INLINE SecondStress<D> pressure(Vec<D> p) const {
        const auto over_J = p * inverse_J_;
        return combined(hn::Neg(over_J), over_J * one_and_trace_);
    }

private:
    Vec<D> B_[6];  ///< 11 22 33 12 23 31
    Vec<D> trace_, one_and_trace_, change_of_square_, inverse_J_;

    HWY_INLINE SecondStress<D> combined(Vec<D> of_B, Vec<D> of_I) const {
        SecondStress<D> s;
        for (int i = 0; i < 3; ++i) {
            s.S[i] = hn::MulAdd(of_B, B_[i], of_I);
            s.S[3 + i] = of_B * B_[3 + i];
        }
        return s;
    }
};

/// S = F⁻¹ P = (cof F)ᵀ P / J of any law.
template <class D>
HWY_INLINE SecondStress<D> second_stress_of(D d, const Strain<D>& strain, const Vec<D> (&P)[3][3]) {
    const auto inverse_J = hn::Set(d, 1) / (hn::Set(d, 1) + strain.change);
    SecondStress<D> s;
    for (int k = 0; k < 6; ++k) {
        const int i = k % 3, j = k < 3 ? i : (i + 1) % 3;
        auto product = cof(d, strain, 0, i) * P[0][j];
        for (int m = 1; m < 3; ++m) product = hn::MulAdd(cof(d, strain, m, i), P[m][j], product);
        s.S[k] = product * inverse_J;
    }
    return s;
}

template <class D>
HWY_INLINE void fill(const SecondStress<D>& s, Vec<D> (&full)[3][3]) {
    for (int i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3;
        full[i][i] = s.S[i];
        full[i][j] = full[j][i] = s.S[3 + i];
    }
}

/// P = F S.
template <class D>
HWY_INLINE void first_stress_of(const SecondStress<D>& s, const Strain<D>& strain, Vec<D> (&P)[3][3]) {
    Vec<D> full[3][3];
    fill<D>(s, full);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            P[i][j] = full[i][j];
            for (int k = 0; k < 3; ++k) P[i][j] = hn::MulAdd(strain.H[i][k], full[k][j], P[i][j]);
        }
}

/// P −= F S.
template <class D>
HWY_INLINE void take_off(const SecondStress<D>& s, const Strain<D>& strain, Vec<D> (&P)[3][3]) {
    Vec<D> full[3][3];
    fill<D>(s, full);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            P[i][j] = P[i][j] - full[i][j];
            for (int k = 0; k < 3; ++k) P[i][j] = hn::NegMulAdd(strain.H[i][k], full[k][j], P[i][j]);
        }
}

}  // namespace HWY_NAMESPACE
}  // namespace tissuewarp::tled::detail
HWY_AFTER_NAMESPACE();

#endif  // TISSUEWARP_CPU_STRAIN_INL
