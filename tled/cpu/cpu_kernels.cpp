// The kernels of cpu_fans-inl.hpp and cpu_elements-inl.hpp for every instruction set, law and scalar,
// chosen at run time.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tled/cpu/cpu_kernels.cpp"
// foreach_target.h must come before highway.h.
// clang-format off
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// clang-format on

#include "tled/cpu/cpu_kernels.hpp"
#include "tled/cpu/cpu_elements-inl.hpp"
#include "tled/cpu/cpu_fans-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace tissuewarp::tled::detail {
namespace HWY_NAMESPACE {

template <class T>
void patch_forces_any(const KernelMaterial<T>& material, Kinematics kinematics, const ElementBatches<T>& elements,
                      const FanPatch& patch, const T* u, const T* pressure, PatchScratch<T>& scratch, T* force,
                      T* shared) {
    with_law(material.law, [&]<class Law>() {
        const T* parameter = material.parameter.data();
        if (kinematics == Kinematics::T4)
            patch_forces_of<Law, Kinematics::T4>(parameter, elements, patch, u, pressure, scratch, force, shared);
        else
            patch_forces_of<Law, Kinematics::AveragedPressure>(parameter, elements, patch, u, pressure, scratch, force,
                                                               shared);
    });
}

template <class T>
void nodal_pressures_any(std::size_t law, const T* modulus, const T* change, T* pressure, std::size_t count) {
    with_law(law, [&]<class Law>() { nodal_pressures_of<Law>(modulus, change, pressure, count); });
}

// Highway dispatches plain functions: one name for each scalar type.
void patch_forces_f32(const KernelMaterial<float>& material, Kinematics kinematics,
                      const ElementBatches<float>& elements, const FanPatch& patch, const float* u,
                      const float* pressure, PatchScratch<float>& scratch, float* force, float* shared) {
    patch_forces_any(material, kinematics, elements, patch, u, pressure, scratch, force, shared);
}
void patch_volume_changes_f32(const ElementBatches<float>& elements, const FanPatch& patch, const float* u,
                              PatchScratch<float>& scratch, float* change) {
    patch_volume_changes_of(elements, patch, u, scratch, change);
}
void advance_nodes_f32(float momentum, float gain, const float* inverse_mass, const float* load, const float* force,
                       const float* free, float* v, float* u, std::size_t count) {
    advance_nodes_of(momentum, gain, inverse_mass, load, force, free, v, u, count);
}
void patch_forces_f64(const KernelMaterial<double>& material, Kinematics kinematics,
                      const ElementBatches<double>& elements, const FanPatch& patch, const double* u,
                      const double* pressure, PatchScratch<double>& scratch, double* force, double* shared) {
    patch_forces_any(material, kinematics, elements, patch, u, pressure, scratch, force, shared);
}
void patch_volume_changes_f64(const ElementBatches<double>& elements, const FanPatch& patch, const double* u,
                              PatchScratch<double>& scratch, double* change) {
    patch_volume_changes_of(elements, patch, u, scratch, change);
}
void advance_nodes_f64(double momentum, double gain, const double* inverse_mass, const double* load,
                       const double* force, const double* free, double* v, double* u, std::size_t count) {
    advance_nodes_of(momentum, gain, inverse_mass, load, force, free, v, u, count);
}
void volume_changes_f32(const ElementBatches<float>& elements, std::size_t begin, std::size_t end, const float* u,
                        float* change) {
    volume_changes_of(elements, begin, end, u, change);
}
void volume_changes_f64(const ElementBatches<double>& elements, std::size_t begin, std::size_t end, const double* u,
                        double* change) {
    volume_changes_of(elements, begin, end, u, change);
}
void nodal_pressures_f32(std::size_t law, const float* modulus, const float* change, float* out, std::size_t count) {
    nodal_pressures_any(law, modulus, change, out, count);
}
void nodal_pressures_f64(std::size_t law, const double* modulus, const double* change, double* out, std::size_t count) {
    nodal_pressures_any(law, modulus, change, out, count);
}
const char* target_name() {
    return hwy::TargetName(HWY_TARGET);
}

}  // namespace HWY_NAMESPACE
}  // namespace tissuewarp::tled::detail
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tissuewarp::tled::detail {

HWY_EXPORT(patch_forces_f32);
HWY_EXPORT(patch_forces_f64);
HWY_EXPORT(patch_volume_changes_f32);
HWY_EXPORT(patch_volume_changes_f64);
HWY_EXPORT(advance_nodes_f32);
HWY_EXPORT(advance_nodes_f64);
HWY_EXPORT(volume_changes_f32);
HWY_EXPORT(volume_changes_f64);
HWY_EXPORT(nodal_pressures_f32);
HWY_EXPORT(nodal_pressures_f64);
HWY_EXPORT(target_name);

template <>
void patch_forces(const KernelMaterial<float>& material, Kinematics kinematics, const ElementBatches<float>& elements,
                  const FanPatch& patch, const float* u, const float* pressure, PatchScratch<float>& scratch,
                  float* force, float* shared) {
    HWY_DYNAMIC_DISPATCH(patch_forces_f32)(material, kinematics, elements, patch, u, pressure, scratch, force, shared);
}
template <>
void patch_volume_changes(const ElementBatches<float>& elements, const FanPatch& patch, const float* u,
                          PatchScratch<float>& scratch, float* change) {
    HWY_DYNAMIC_DISPATCH(patch_volume_changes_f32)(elements, patch, u, scratch, change);
}
template <>
void advance_nodes(float momentum, float gain, const float* inverse_mass, const float* load, const float* force,
                   const float* free, float* v, float* u, std::size_t count) {
    HWY_DYNAMIC_DISPATCH(advance_nodes_f32)(momentum, gain, inverse_mass, load, force, free, v, u, count);
}
template <>
void patch_forces(const KernelMaterial<double>& material, Kinematics kinematics, const ElementBatches<double>& elements,
                  const FanPatch& patch, const double* u, const double* pressure, PatchScratch<double>& scratch,
                  double* force, double* shared) {
    HWY_DYNAMIC_DISPATCH(patch_forces_f64)(material, kinematics, elements, patch, u, pressure, scratch, force, shared);
}
template <>
void patch_volume_changes(const ElementBatches<double>& elements, const FanPatch& patch, const double* u,
                          PatchScratch<double>& scratch, double* change) {
    HWY_DYNAMIC_DISPATCH(patch_volume_changes_f64)(elements, patch, u, scratch, change);
}
template <>
void advance_nodes(double momentum, double gain, const double* inverse_mass, const double* load, const double* force,
                   const double* free, double* v, double* u, std::size_t count) {
    HWY_DYNAMIC_DISPATCH(advance_nodes_f64)(momentum, gain, inverse_mass, load, force, free, v, u, count);
}
template <>
void volume_changes(const ElementBatches<float>& elements, std::size_t begin, std::size_t end, const float* u,
                    float* change) {
    HWY_DYNAMIC_DISPATCH(volume_changes_f32)(elements, begin, end, u, change);
}
template <>
void volume_changes(const ElementBatches<double>& elements, std::size_t begin, std::size_t end, const double* u,
                    double* change) {
    HWY_DYNAMIC_DISPATCH(volume_changes_f64)(elements, begin, end, u, change);
}
template <>
void nodal_pressures(std::size_t law, const float* modulus, const float* change, float* pressure, std::size_t count) {
    HWY_DYNAMIC_DISPATCH(nodal_pressures_f32)(law, modulus, change, pressure, count);
}
template <>
void nodal_pressures(std::size_t law, const double* modulus, const double* change, double* pressure,
                     std::size_t count) {
    HWY_DYNAMIC_DISPATCH(nodal_pressures_f64)(law, modulus, change, pressure, count);
}

const char* instruction_set() {
    return HWY_DYNAMIC_DISPATCH(target_name)();
}

}  // namespace tissuewarp::tled::detail
#endif  // HWY_ONCE
