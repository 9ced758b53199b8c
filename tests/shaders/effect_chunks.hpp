#pragma once
/// The effects that programs may have or lack, for the tests that look for what is left of absent ones.

#include "shaders/catalogue.hpp"

#include <array>

namespace tissuewarp::shaders::effect_chunks {

/// An effect of a set of flags: its chunk, its storage block, the flag that its readers declare, and a word that no
/// other effect's text has.
template <class Flags>
struct EffectChunk {
    bool Flags::*flag;
    const char *file, *block, *name, *word;
};

inline constexpr std::array<EffectChunk<NodeEffects>, 5> on_nodes{{
    {&NodeEffects::springs, "chunks/node.springs.glsl", "Springs", "HAS_SPRINGS", "spring"},
    {&NodeEffects::external_force, "chunks/node.external_force.glsl", "ExternalForce", "HAS_EXTERNAL_FORCE",
     "external"},
    {&NodeEffects::surface_force, "chunks/node.surface_force.glsl", "SurfaceForce", "HAS_SURFACE_FORCE", "surface"},
    {&NodeEffects::fluid, "chunks/node.fluid.glsl", "Fluid", "HAS_FLUID", "fluid"},
    {&NodeEffects::contact, "chunks/node.contact.glsl", "Contact", "HAS_CONTACT", "contact"},
}};

/// Of bodies in contact, whose block it reads.
inline constexpr EffectChunk<NodeEffects> turning{&NodeEffects::turning, "chunks/node.turning.glsl", "Contact",
                                                  "HAS_TURNING", "turn_of"};

/// Their lists share a block.
inline constexpr std::array<EffectChunk<SurfaceForces>, 4> on_surfaces{{
    {&SurfaceForces::pressure, "chunks/surface.pressure.glsl", "SurfaceEffects", "HAS_PRESSURE", "pressure"},
    {&SurfaceForces::membrane, "chunks/surface.membrane.glsl", "SurfaceEffects", "HAS_MEMBRANE", "membrane"},
    {&SurfaceForces::sliding, "chunks/surface.sliding.glsl", "SurfaceEffects", "HAS_SLIDING", "sliding"},
    {&SurfaceForces::parting, "chunks/surface.parting.glsl", "SurfaceEffects", "HAS_PARTING", "parting"},
}};

inline constexpr NodeEffects all_on_nodes{true, true, true, true, true, true};
inline constexpr SurfaceForces all_on_surfaces{true, true, true, true};

template <class Flags>
Flags without(Flags all, const EffectChunk<Flags>& effect) {
    all.*effect.flag = false;
    return all;
}

inline constexpr PatchStages whole_step{
    .advances = true, .volumes = true, .forces = true, .averages = true, .persists = true};

}  // namespace tissuewarp::shaders::effect_chunks
