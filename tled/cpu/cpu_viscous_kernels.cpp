// Viscous stresses in the element pass, for every instruction set, law and scalar, chosen at run time.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tled/cpu/cpu_viscous_kernels.cpp"
// foreach_target.h must come before highway.h.
// clang-format off
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// clang-format on

#include "tled/cpu/cpu_elements-inl.hpp"
#include "tled/cpu/cpu_fans-inl.hpp"
#include "tled/cpu/cpu_kernels.hpp"

HWY_BEFORE_NAMESPACE();
namespace tissuewarp::tled::detail {
namespace HWY_NAMESPACE {

/// Of a batch: terms × 6 × width.
template <class T, class Viscous>
HWY_INLINE T* stresses_of(Viscous& viscous, std::size_t batch, int lane) {
    return viscous.stress.data() + (batch - viscous.first_batch) * viscous.coefficient.size() * 6 * batch_width + lane;
}

/// Σ q⁺ with q⁺ = a S + b q.
template <class T>
struct PronyRelaxation {
    ViscousBatches<T>* viscous;
    Stresses stresses;

    template <class D>
    HWY_INLINE SecondStress<D> operator()(D d, std::size_t batch, int lane, const SecondStress<D>& s) const {
        SecondStress<D> sum;
        for (int k = 0; k < 6; ++k) sum.S[k] = hn::Zero(d);
        T* stress = stresses_of<T>(*viscous, batch, lane);
        for (const auto& [a, b] : viscous->coefficient)
            for (int k = 0; k < 6; ++k, stress += batch_width) {
                const auto q = hn::MulAdd(hn::Set(d, a), s.S[k], hn::Set(d, b) * hn::Load(d, stress));
                if (stresses == Stresses::Move) hn::Store(q, d, stress);
                sum.S[k] = sum.S[k] + q;
            }
        return sum;
    }
};

/// Σ q as they rest: no S is needed.
template <class T>
struct RestingStresses {
    const ViscousBatches<T>* viscous;

    template <class D>
    HWY_INLINE SecondStress<D> operator()(D d, std::size_t batch, int lane) const {
        const T* stress = stresses_of<const T>(*viscous, batch, lane);
        SecondStress<D> sum;
        for (int k = 0; k < 6; ++k, stress += batch_width) sum.S[k] = hn::Load(d, stress);
        for (std::size_t term = 1; term < viscous->coefficient.size(); ++term)
            for (int k = 0; k < 6; ++k, stress += batch_width) sum.S[k] = sum.S[k] + hn::Load(d, stress);
        return sum;
    }
};

/// body(what becomes of the stress of a batch after the law).
template <class T, class Body>
void with_stresses(ViscousBatches<T>& viscous, Stresses stresses, const Body& body) {
    if (stresses == Stresses::Rest)
        body(RestingStresses<T>{&viscous});
    else
        body(PronyRelaxation<T>{&viscous, stresses});
}

template <class T>
void viscous_patch_forces_any(const KernelMaterial<T>& material, ViscousBatches<T>& viscous, Stresses stresses,
                              Kinematics kinematics, const ElementBatches<T>& elements, const FanPatch& patch,
                              const T* u, const T* pressure, PatchScratch<T>& scratch, T* force, T* shared) {
    with_law(material.law, [&]<class Law>() {
        const T* parameter = material.parameter.data();
        with_stresses(viscous, stresses, [&](const auto& after_shear) {
            if (kinematics == Kinematics::T4)
                patch_forces_of<Law, Kinematics::T4>(parameter, elements, patch, u, pressure, scratch, force, shared,
                                                     after_shear);
            else
                patch_forces_of<Law, Kinematics::AveragedPressure>(parameter, elements, patch, u, pressure, scratch,
                                                                   force, shared, after_shear);
        });
    });
}

// Highway dispatches plain functions: one name for each scalar type.
void viscous_patch_forces_f32(const KernelMaterial<float>& material, ViscousBatches<float>& viscous, Stresses stresses,
                              Kinematics kinematics, const ElementBatches<float>& elements, const FanPatch& patch,
                              const float* u, const float* pressure, PatchScratch<float>& scratch, float* force,
                              float* shared) {
    viscous_patch_forces_any(material, viscous, stresses, kinematics, elements, patch, u, pressure, scratch, force,
                             shared);
}
void viscous_patch_forces_f64(const KernelMaterial<double>& material, ViscousBatches<double>& viscous,
                              Stresses stresses, Kinematics kinematics, const ElementBatches<double>& elements,
                              const FanPatch& patch, const double* u, const double* pressure,
                              PatchScratch<double>& scratch, double* force, double* shared) {
    viscous_patch_forces_any(material, viscous, stresses, kinematics, elements, patch, u, pressure, scratch, force,
                             shared);
}
}  // namespace HWY_NAMESPACE
}  // namespace tissuewarp::tled::detail
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tissuewarp::tled::detail {

HWY_EXPORT(viscous_patch_forces_f32);
HWY_EXPORT(viscous_patch_forces_f64);

template <>
void viscous_patch_forces(const KernelMaterial<float>& material, ViscousBatches<float>& viscous, Stresses stresses,
                          Kinematics kinematics, const ElementBatches<float>& elements, const FanPatch& patch,
                          const float* u, const float* pressure, PatchScratch<float>& scratch, float* force,
                          float* shared) {
    HWY_DYNAMIC_DISPATCH(viscous_patch_forces_f32)
    (material, viscous, stresses, kinematics, elements, patch, u, pressure, scratch, force, shared);
}
template <>
void viscous_patch_forces(const KernelMaterial<double>& material, ViscousBatches<double>& viscous, Stresses stresses,
                          Kinematics kinematics, const ElementBatches<double>& elements, const FanPatch& patch,
                          const double* u, const double* pressure, PatchScratch<double>& scratch, double* force,
                          double* shared) {
    HWY_DYNAMIC_DISPATCH(viscous_patch_forces_f64)
    (material, viscous, stresses, kinematics, elements, patch, u, pressure, scratch, force, shared);
}
}  // namespace tissuewarp::tled::detail
#endif
