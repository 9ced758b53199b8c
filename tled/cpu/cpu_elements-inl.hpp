// The element pass of total Lagrangian dynamics (Miller et al. 2007, section 3) for batches of linear tetrahedra:
// displacement gradient from precomputed derivatives, first Piola–Kirchhoff stress, corner forces f_a = V P ∂N_a/∂X.
// Included once for each instruction set (Highway's convention for -inl files).
//
// Stresses are written in H = F − I, cof F − I, C − I and J − 1, so that float32 keeps small strains.

// clang-format off
#if defined(TISSUEWARP_CPU_ELEMENTS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef TISSUEWARP_CPU_ELEMENTS_INL
#undef TISSUEWARP_CPU_ELEMENTS_INL
#else
#define TISSUEWARP_CPU_ELEMENTS_INL
#endif
// clang-format on

#include <hwy/highway.h>

#include <type_traits>

#include "tled/cpu/cpu_kernels.hpp"
#include "tled/cpu/cpu_laws-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace tissuewarp::tled::detail {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

template <class D, class T>
HWY_INLINE Vec<D> gather(D d, const T* base, const std::int32_t* index) {
    const hn::RebindToSigned<D> di;
    if constexpr (sizeof(T) == 4)
        return hn::GatherIndex(d, base, hn::LoadU(di, index));
    else
        return hn::GatherIndex(d, base, hn::PromoteTo(di, hn::LoadU(hn::Rebind<std::int32_t, D>(), index)));
}

template <class D, class T>
void displacement_gradient(D d, const ElementBatches<T>& elements, std::size_t batch, int lane, const T* u,
                           Vec<D> (&H)[3][3]) {
    const std::int32_t* node = &elements.node[batch * 4 * batch_width + lane];
    const T* gradient = &elements.gradient[batch * 9 * batch_width + lane];
    Vec<D> difference[3][3];  // [component][k]: u_{k+1} − u_0
    for (int c = 0; c < 3; ++c) {
        const auto u0 = gather(d, u + c, node);
        for (int k = 0; k < 3; ++k) difference[c][k] = gather(d, u + c, node + (k + 1) * batch_width) - u0;
    }
    for (int j = 0; j < 3; ++j) {
        const auto b0 = hn::LoadU(d, gradient + j * batch_width);
        const auto b1 = hn::LoadU(d, gradient + (3 + j) * batch_width);
        const auto b2 = hn::LoadU(d, gradient + (6 + j) * batch_width);
        for (int i = 0; i < 3; ++i)
            H[i][j] = hn::MulAdd(difference[i][0], b0, hn::MulAdd(difference[i][1], b1, difference[i][2] * b2));
    }
}

/// J − 1 where J > 0, NaN elsewhere for laws that know no inverted state: Highway's logarithm gives a finite number for
/// one, which would pass as a force.
template <class Law, class D>
HWY_INLINE Vec<D> admissible(D d, Vec<D> change) {
    if constexpr (Response<Law>::admits_inversion)
        return change;
    else
        return hn::IfThenElse(change > hn::Set(d, -1), change, hn::NaN(d));
}

template <class D, class T>
Strain<D> strain_of(D d, const ElementBatches<T>& elements, std::size_t batch, int lane, const T* u) {
    Strain<D> strain;
    displacement_gradient(d, elements, batch, lane, u, strain.H);
    finish_strain(d, strain);
    return strain;
}

/// Elastic tissue: nothing happens to the stress of a batch.
struct Elastic {};

/// Tissue whose viscous stresses are known before its S.
template <class D, class AfterShear>
concept knows_its_stresses = requires(D d, const AfterShear& stresses) {
    stresses(d, std::size_t{}, int{});
};

/// P times `volume`: of the law's shear part, and `scaled_pressure` (V p) times cof F.
template <class Law, class D>
HWY_INLINE void elastic_stress(D d, const Strain<D>& strain, const Tissue<D>& tissue, Vec<D> volume,
                               Vec<D> scaled_pressure, Vec<D> (&P)[3][3]) {
    if constexpr (has_factors<Law, D>) {
        auto factors = Response<Law>::shear_factors(d, strain, tissue, volume);
        factors.of_I = factors.of_I + scaled_pressure;
        stress_of<D>(factors, strain, P);
    } else {
        shear_stress<Law>(d, strain, tissue, volume, P);
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) P[i][j] = hn::MulAdd(scaled_pressure, cof(d, strain, i, j), P[i][j]);
    }
}

/// The same, less what `after_shear` takes off its S = F⁻¹ P.
template <class Law, class D, class AfterShear>
HWY_INLINE void stress(D d, std::size_t batch, int lane, const Strain<D>& strain, const Tissue<D>& tissue,
                       Vec<D> volume, Vec<D> scaled_pressure, const AfterShear& after_shear, Vec<D> (&P)[3][3]) {
    if constexpr (std::is_same_v<AfterShear, Elastic>) {
        elastic_stress<Law>(d, strain, tissue, volume, scaled_pressure, P);
    } else if constexpr (has_factors<Law, D> && knows_its_stresses<D, AfterShear>) {
        auto factors = Response<Law>::shear_factors(d, strain, tissue, volume);
        factors.of_I = factors.of_I + scaled_pressure;
        const SecondStressOf<D> second(d, strain);
        auto S = second.shear(factors);
        const auto relaxed = after_shear(d, batch, lane);
        for (int k = 0; k < 6; ++k) S.S[k] = S.S[k] - relaxed.S[k];
        first_stress_of<D>(S, strain, P);
    } else if constexpr (knows_its_stresses<D, AfterShear>) {
        elastic_stress<Law>(d, strain, tissue, volume, scaled_pressure, P);
        take_off<D>(after_shear(d, batch, lane), strain, P);
    } else if constexpr (has_factors<Law, D>) {
        const SecondStressOf<D> second(d, strain);
        auto S = second.shear(Response<Law>::shear_factors(d, strain, tissue, volume));
        const auto relaxed = after_shear(d, batch, lane, S), pressure = second.pressure(scaled_pressure);
        for (int k = 0; k < 6; ++k) S.S[k] = S.S[k] - relaxed.S[k] + pressure.S[k];
        first_stress_of<D>(S, strain, P);
    } else {
        shear_stress<Law>(d, strain, tissue, volume, P);
        take_off<D>(after_shear(d, batch, lane, second_stress_of(d, strain, P)), strain, P);
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) P[i][j] = hn::MulAdd(scaled_pressure, cof(d, strain, i, j), P[i][j]);
    }
}

/// What the law knows of a batch.
template <class Law, class D, class T>
HWY_INLINE Tissue<D> tissue_of(D d, const T* parameter, const ElementBatches<T>& elements, std::size_t batch,
                               int lane) {
    Tissue<D> tissue;
    tissue.parameter = parameter;
    if constexpr (Response<Law>::has_fibre)
        for (int c = 0; c < 3; ++c)
            tissue.fibre[c] = hn::LoadU(d, &elements.fibre[(batch * 3 + c) * batch_width + lane]);
    return tissue;
}

template <class T>
void volume_changes_of(const ElementBatches<T>& elements, std::size_t begin, std::size_t end, const T* u, T* change) {
    const hn::CappedTag<T, batch_width> d;
    const int lanes = static_cast<int>(hn::Lanes(d));
    for (std::size_t batch = begin; batch < end; ++batch)
        for (int lane = 0; lane < batch_width; lane += lanes)
            hn::StoreU(strain_of(d, elements, batch, lane, u).change, d,
                       change + batch * batch_width + static_cast<std::size_t>(lane));
}

template <class Law, class T>
void nodal_pressures_of(const T* modulus, const T* change, T* pressure, std::size_t count) {
    const hn::CappedTag<T, batch_width> d;
    const std::size_t lanes = hn::Lanes(d);
    std::size_t i = 0;
    for (; i + lanes <= count; i += lanes)
        hn::StoreU(
            hn::LoadU(d, modulus + i) * Response<Law>::pressure_factor(d, admissible<Law>(d, hn::LoadU(d, change + i))),
            d, pressure + i);
    const hn::CappedTag<T, 1> one;
    for (; i < count; ++i)
        hn::StoreU(hn::LoadU(one, modulus + i) *
                       Response<Law>::pressure_factor(one, admissible<Law>(one, hn::LoadU(one, change + i))),
                   one, pressure + i);
}

/// Calls `run` with the law of index `law` as template argument.
template <std::size_t index = 0, class Run>
void with_law(std::size_t law, const Run& run) {
    if constexpr (index < std::variant_size_v<Material>) {
        if (law == index)
            run.template operator()<std::variant_alternative_t<index, Material>>();
        else
            with_law<index + 1>(law, run);
    }
}

}  // namespace HWY_NAMESPACE
}  // namespace tissuewarp::tled::detail
HWY_AFTER_NAMESPACE();

#endif  // TISSUEWARP_CPU_ELEMENTS_INL
