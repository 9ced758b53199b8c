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

}  // namespace HWY_NAMESPACE
}  // namespace tissuewarp::tled::detail
HWY_AFTER_NAMESPACE();

#endif  // TISSUEWARP_CPU_STRAIN_INL
