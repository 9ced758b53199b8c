#pragma once
/// The programs that kernels and chunks make: which chunks and flags each kernel takes.

#include "shaders/program_source.hpp"

#include <string>
#include <vector>

namespace tissuewarp::shaders {

/// Chunks law.*.glsl.
enum class Law {
    NeoHookeanIso,
    NeoHookeanLnJ,
    NeoHookeanStable,
    Polynomial,
    ArrudaBoyce,
    Ogden,
    TransverselyIsotropic,
};
inline constexpr int law_count = 7;

/// Where the volumetric stress is evaluated: chunks pressure.*.glsl.
enum class PressureRule {
    Element,                  ///< in each element
    Averaged,                 ///< at nodes
    AveragedWithElementPart,  ///< at nodes, and a part in each element
};

/// Viscous stresses in the element pass: none, read as they are at the end of the step, or advanced with it.
enum class Viscosity { None, Hold, Advance };

/// What the element pass of a law computes.
struct ElementForces {
    Law law = Law::NeoHookeanIso;
    PressureRule pressure = PressureRule::Element;
    Viscosity viscosity = Viscosity::None;
    int prony_terms = 0;  ///< of the scene's materials, the most; at least 1 with viscosity
};

/// Effects that act on nodes; what is absent costs no read and no instruction.
struct NodeEffects {
    bool springs = false;
    bool external_force = false;
    bool surface_force = false;  ///< what surface_force_program leaves
    bool fluid = false;
    bool contact = false;
    bool turning = false;  ///< of bodies in contact
};

/// Effects whose force on a node depends on where others are: chunks surface.*.glsl.
struct SurfaceForces {
    bool pressure = false;
    bool membrane = false;
    bool sliding = false;
    bool parting = false;
};

/// The most that a pass over elements or nodes declares; those over patches are counted in tled/gpu/gpu_patches.cpp.
inline constexpr int storage_blocks_of_passes = 11;

enum class StoreResidual { No, Yes };
enum class MaskConstrained { No, Yes };

ProgramSource element_force_program(const ElementForces& forces);
ProgramSource element_volume_program();
ProgramSource nodal_pressure_program(Law law);
ProgramSource surface_force_program(const SurfaceForces& forces);
ProgramSource node_step_program(const NodeEffects& effects, StoreResidual store);
/// Does not know contact.
ProgramSource node_residual_program(const NodeEffects& effects, MaskConstrained mask);

/// Sizes that are constants of the programs over patches; those of the mesh are uniforms (chunks/patch.glsl).
struct PatchSizes {
    int slots = 64;            ///< for each patch, in shared memory
    int workgroup = 128;       ///< invocations
    bool each_has_one = true;  ///< where a dispatch persists: whether each workgroup has one patch
    int places = 0;            ///< where each has one: tetrahedra whose viscous stresses stay in shared memory
};
/// What one dispatch over patches does (kernels/patch_step.comp).
struct PatchStages {
    bool advances = false, volumes = false, forces = false;
    bool averages = false;  ///< the pressure
    bool persists = false;  ///< goes on for many steps
    bool rests = false;     ///< viscous stresses do, in its forces
};
/// What the tetrahedra of patches are made of: laws with fibres have one for each of them.
struct PatchTissue {
    Law law = Law::NeoHookeanIso;
    int prony_terms = 0;  ///< of the scene's materials, the most; 0: elastic
};
/// One workgroup for each patch; all effects but surface forces, whose nodes other patches may hold.
ProgramSource patch_step_program(const PatchTissue& tissue, const NodeEffects& effects, const PatchSizes& sizes,
                                 const PatchStages& stages);
bool has_fibres(Law law);
/// Viscous stresses from elements to patches, or back; the sum of the terms, which rests.
enum class PatchStresses { Load, Store, Sum };
ProgramSource patch_stress_program(const PatchTissue& tissue, PatchStresses what);
ProgramSource patch_load_program();
ProgramSource patch_store_program();

ProgramSource impose_program();
ProgramSource previous_displacement_program();

/// Workgroups of the observing programs, each of which leaves one partial result.
inline constexpr int observe_partials = 128;
ProgramSource observe_nodes_program();
ProgramSource observe_elements_program();

/// The warp of an image (registration/gpu_warp.hpp), in the order of its passes. Outside the mesh the tissue follows a
/// field that the host left, or the placement alone.
enum class WarpContinuation { None, Given };
enum class WarpTakes { Trilinear, Nearest };
/// Invocations for each portion of a tetrahedron.
inline constexpr int warp_portion_lanes = 32;
ProgramSource warp_clear_program();
ProgramSource warp_elements_program();
ProgramSource warp_rasterise_program();
ProgramSource warp_image_program(WarpContinuation continuation, WarpTakes takes);
ProgramSource warp_field_program(WarpContinuation continuation);

/// Image matching (registration/matching/gpu/match_device.hpp), in the order of its passes: kernels match_*.comp.
/// SampleStill reads the fixed image where it lies.
enum class MatchPass {
    Blur,
    Field,
    Grow,
    Sample,
    SampleStill,
    Difference,
    Mean,
    Distance,
    Smooth,
    Erode,
    Describe,
    Forces,
    Window,
    Solve,
    Look,
    Walk,
    LinearBricks,
    LinearWindow,
    LinearCosts,
    StructureBricks,
    StructureWindow,
    StructureCosts
};
inline constexpr int match_pass_count = 22;
/// Steps downhill of MatchPass::Walk, at most.
inline constexpr int match_walk_steps = 8;
/// Candidates from which it begins, at most; they are among one of so many places of a first look, the lowest.
inline constexpr int match_most_candidates = 27, match_candidates_one_of = 20;
/// Workgroups of MatchPass::Difference, and invocations of MatchPass::Mean, which merges what they leave.
inline constexpr int match_partials = 128;
/// Voxels along each axis of a cell of forces; its cube is the workgroup of MatchPass::Forces.
inline constexpr int match_cell_side = 4;
/// `descriptor_reach`: voxels around one that must be seen for its descriptor to count.
ProgramSource match_program(MatchPass pass, int descriptor_reach);

/// What measures a device's ceilings (ceilings.hpp).
ProgramSource copy_bandwidth_program();
inline constexpr int fma_per_round = 64;
ProgramSource fma_rate_program();

/// Every compute program that the functions above can make, for checking them all.
std::vector<ProgramSource> every_program();

/// The render passes of 2007 (shaders/render_pass/): the vertex stage of all of them, and their fragment stages. The
/// law is one without fibres.
ProgramSource full_screen_vertices();
ProgramSource element_forces_pass(Law law);
ProgramSource node_step_pass();
/// Every stage that these three can make.
std::vector<ProgramSource> every_render_pass();

}  // namespace tissuewarp::shaders
