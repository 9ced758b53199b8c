// The programs that scenes may ask for, enumerated: what compilers and tests go through.
#include "shaders/catalogue.hpp"

#include <array>
#include <bit>
#include <vector>

namespace tissuewarp::shaders {
namespace {

PatchStages resting(PatchStages stages) {
    stages.rests = true;
    return stages;
}

/// But the one that advances alone, which knows no law.
constexpr std::array<PatchStages, 7> every_patch_stages{{
    {.forces = true},
    {.advances = true, .forces = true},
    {.advances = true, .forces = true, .persists = true},
    {.volumes = true, .averages = true},
    {.forces = true, .averages = true},
    {.advances = true, .volumes = true, .averages = true},
    {.advances = true, .volumes = true, .forces = true, .averages = true, .persists = true},
}};

/// None of these flags, each alone, each pair and all: what one effect's chunk takes from another's, a name or a
/// binding, shows in a pair.
template <class Effects, std::size_t count>
std::vector<Effects> combinations(const std::array<bool Effects::*, count>& flags) {
    std::vector<Effects> all;
    for (unsigned chosen = 0; chosen < 1U << count; ++chosen) {
        if (const int size = std::popcount(chosen); size > 2 && size < static_cast<int>(count)) continue;
        Effects& effects = all.emplace_back();
        for (std::size_t i = 0; i < count; ++i) effects.*flags[i] = (chosen >> i & 1U) != 0;
    }
    return all;
}

/// The same, but of effects of which turning is one, which there is with contact only.
template <std::size_t count>
std::vector<NodeEffects> with_contact(const std::array<bool NodeEffects::*, count>& flags) {
    std::vector<NodeEffects> all = combinations<NodeEffects, count>(flags);
    std::erase_if(all, [](const NodeEffects& effects) { return effects.turning && !effects.contact; });
    return all;
}

void add_node_passes(std::vector<ProgramSource>& all) {
    using E = NodeEffects;
    for (const NodeEffects& effects :
         with_contact<6>({&E::springs, &E::external_force, &E::surface_force, &E::fluid, &E::contact, &E::turning}))
        for (const StoreResidual store : {StoreResidual::No, StoreResidual::Yes})
            all.push_back(node_step_program(effects, store));
    for (const NodeEffects& effects :
         combinations<E, 4>({&E::springs, &E::external_force, &E::surface_force, &E::fluid}))
        for (const MaskConstrained mask : {MaskConstrained::No, MaskConstrained::Yes})
            all.push_back(node_residual_program(effects, mask));
    using S = SurfaceForces;
    for (const SurfaceForces& forces : combinations<S, 4>({&S::pressure, &S::membrane, &S::sliding, &S::parting}))
        if (forces.pressure || forces.membrane || forces.sliding || forces.parting)
            all.push_back(surface_force_program(forces));
}

/// Laws and effects do not meet in the code of a patch: every law, elastic and viscous, with no effect and with all of
/// them, one law with the other combinations. Viscosity is in stages with forces, and may stay in shared memory where
/// they go on.
void add_patch_steps(std::vector<ProgramSource>& all) {
    using E = NodeEffects;
    const std::vector<NodeEffects> effects =
        with_contact<5>({&E::springs, &E::external_force, &E::fluid, &E::contact, &E::turning});
    for (const NodeEffects& each : effects) all.push_back(patch_step_program({}, each, {}, {.advances = true}));
    for (const PatchStages& stages : every_patch_stages) {
        for (int law = 0; law < law_count; ++law)
            for (const NodeEffects& each : {effects.front(), effects.back()}) {
                const PatchTissue elastic{static_cast<Law>(law)}, viscous{static_cast<Law>(law), 3};
                all.push_back(patch_step_program(elastic, each, {}, stages));
                if (stages.forces) all.push_back(patch_step_program(viscous, each, {}, stages));
                if (stages.forces) all.push_back(patch_step_program(viscous, each, {}, resting(stages)));
                if (stages.forces && stages.persists)
                    all.push_back(patch_step_program(viscous, each, {.places = 64}, stages));
            }
        for (std::size_t i = 1; i + 1 < effects.size(); ++i)
            all.push_back(patch_step_program({Law::NeoHookeanIso}, effects[i], {}, stages));
    }
}

}  // namespace

std::vector<ProgramSource> every_program() {
    std::vector<ProgramSource> all{element_volume_program(), impose_program(), previous_displacement_program(),
                                   observe_nodes_program(), observe_elements_program()};
    for (int index = 0; index < law_count; ++index) {
        const auto law = static_cast<Law>(index);
        for (const PressureRule rule :
             {PressureRule::Element, PressureRule::Averaged, PressureRule::AveragedWithElementPart})
            for (const Viscosity viscosity : {Viscosity::None, Viscosity::Hold, Viscosity::Advance})
                all.push_back(element_force_program({law, rule, viscosity, 3}));
        all.push_back(nodal_pressure_program(law));
    }
    add_node_passes(all);
    add_patch_steps(all);
    for (const bool fibres : {false, true})
        for (const PatchStresses what : {PatchStresses::Load, PatchStresses::Store, PatchStresses::Sum})
            all.push_back(patch_stress_program({fibres ? Law::TransverselyIsotropic : Law::NeoHookeanIso, 3}, what));
    all.push_back(patch_load_program());
    all.push_back(patch_store_program());
    all.push_back(warp_clear_program());
    all.push_back(warp_elements_program());
    all.push_back(warp_rasterise_program());
    for (const WarpContinuation continuation : {WarpContinuation::None, WarpContinuation::Given}) {
        all.push_back(warp_field_program(continuation));
        for (const WarpTakes takes : {WarpTakes::Trilinear, WarpTakes::Nearest})
            all.push_back(warp_image_program(continuation, takes));
    }
    for (int pass = 0; pass < match_pass_count; ++pass) all.push_back(match_program(static_cast<MatchPass>(pass), 3));
    all.push_back(copy_bandwidth_program());
    all.push_back(fma_rate_program());
    return all;
}

std::vector<ProgramSource> every_render_pass() {
    std::vector<ProgramSource> all{full_screen_vertices(), node_step_pass()};
    for (int law = 0; law < law_count; ++law)
        if (static_cast<Law>(law) != Law::TransverselyIsotropic)
            all.push_back(element_forces_pass(static_cast<Law>(law)));
    return all;
}

}  // namespace tissuewarp::shaders
