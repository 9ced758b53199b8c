#include "shaders/catalogue.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace tissuewarp::shaders {
namespace {

// 128 invocations keep enough registers for the element kernels on all hardware known to us; 256 lanes of 24 bytes are
// far below the 32 KiB of shared memory that OpenGL guarantees.
constexpr const char* workgroup_size = "128";
constexpr const char* observe_workgroup_size = "256";

/// A string of one character rather than a literal: g++ 12 warns of an overlapping copy in the literal's assignment
/// (GCC bug 105651).
std::string flag(bool on) {
    return std::string(1, on ? '1' : '0');
}

constexpr std::array<const char*, law_count> law_chunk{
    "law.neo_hookean_iso", "law.neo_hookean_lnj", "law.neo_hookean_stable",     "law.polynomial",
    "law.arruda_boyce",    "law.ogden",           "law.transversely_isotropic",
};

/// The law, after its volumetric function where that has a chunk of its own.
void add_law(ProgramSource& source, Law law) {
    if (law != Law::NeoHookeanLnJ && law != Law::ArrudaBoyce) source.chunks.emplace_back("volume.quadratic");
    source.chunks.emplace_back(law_chunk.at(static_cast<std::size_t>(law)));
}

/// An effect's chunk where the scene has it, and its flag either way.
void add_effect(ProgramSource& source, const char* chunk, const char* name, bool present) {
    if (present) source.chunks.emplace_back(chunk);
    source.defines[name] = flag(present);
}

/// Forces that depend on the node alone.
void add_nodal_forces(ProgramSource& source, const NodeEffects& effects) {
    add_effect(source, "node.springs", "HAS_SPRINGS", effects.springs);
    add_effect(source, "node.external_force", "HAS_EXTERNAL_FORCE", effects.external_force);
    add_effect(source, "node.fluid", "HAS_FLUID", effects.fluid);
}

/// `settles` is the chunk whose settle() the program calls.
void add_contact(ProgramSource& source, const NodeEffects& effects, const char* settles) {
    add_effect(source, "node.contact", "HAS_CONTACT", effects.contact);
    if (!effects.contact) return;
    add_effect(source, "node.turning", "HAS_TURNING", effects.turning);
    source.chunks.emplace_back(settles);
}

ProgramSource node_program(std::string kernel, const NodeEffects& effects) {
    ProgramSource source{std::move(kernel), {"index", "bindings", "node"}, {{"WORKGROUP_SIZE", workgroup_size}}, {}};
    add_nodal_forces(source, effects);
    add_effect(source, "node.surface_force", "HAS_SURFACE_FORCE", effects.surface_force);
    source.chunks.emplace_back("node.residual");
    return source;
}

bool moves_stresses(const PatchTissue& tissue, const PatchStages& stages) {
    return tissue.prony_terms > 0 && !stages.rests;
}

/// Whether patches take S from the law: these make theirs of stretch_difference.
bool gives_second(Law law) {
    constexpr std::array laws{Law::NeoHookeanIso, Law::NeoHookeanLnJ, Law::ArrudaBoyce, Law::TransverselyIsotropic};
    return std::find(laws.begin(), laws.end(), law) != laws.end();
}

std::string unsigned_number(int number) {
    return std::to_string(number) + "u";
}

/// Places in shared memory for the viscous stresses of a patch that move; 0 where they do not stay there.
int places_of_stresses(const PatchTissue& tissue, const PatchSizes& sizes, const PatchStages& stages) {
    return moves_stresses(tissue, stages) && stages.forces && stages.persists && sizes.each_has_one ? sizes.places : 0;
}

/// What tetrahedra have for themselves and the forces that follow from it.
void add_patch_forces(ProgramSource& source, const PatchTissue& tissue, const PatchSizes& sizes,
                      const PatchStages& stages) {
    const bool fibres = has_fibres(tissue.law), viscous = tissue.prony_terms > 0;
    if (viscous) source.chunks.emplace_back("viscosity");
    if (fibres || viscous) source.chunks.emplace_back("patch.tissue");
    if (fibres) source.chunks.emplace_back("patch.fibre");
    if (viscous) source.chunks.emplace_back("patch.stresses");
    const bool moves = moves_stresses(tissue, stages);
    const int places = places_of_stresses(tissue, sizes, stages);
    if (moves) {
        source.chunks.emplace_back(places > 0 ? "patch.stresses.shared" : "patch.stresses.memory");
        source.chunks.emplace_back("patch.viscosity");
    } else if (viscous) {
        source.chunks.emplace_back("patch.resting");
    }
    if (viscous) source.defines["PRONY_TERMS"] = unsigned_number(tissue.prony_terms);
    if (places > 0) source.defines["PLACES"] = unsigned_number(places);
    if (viscous) source.defines["LAW_GIVES_SECOND"] = flag(gives_second(tissue.law));
    source.chunks.emplace_back("patch.forces");
    source.defines["HAS_FIBRES"] = flag(fibres);
    source.defines["HAS_VISCOSITY"] = flag(viscous);
    source.defines["MOVES_STRESSES"] = flag(moves);
}

ProgramSource warp_program(std::string kernel) {
    return {std::move(kernel), {"index", "warp"}, {{"WORKGROUP_SIZE", workgroup_size}}, {}};
}

/// A pass over the voxels of the output.
ProgramSource warp_program(std::string kernel, WarpContinuation continuation) {
    ProgramSource source = warp_program(std::move(kernel));
    const bool continued = continuation == WarpContinuation::Given;
    if (continued) source.chunks.emplace_back("warp.continuation");
    source.chunks.emplace_back("warp.inverse");
    source.defines["HAS_CONTINUATION"] = flag(continued);
    return source;
}

struct MatchKernel {
    const char* kernel;
    std::vector<std::string> chunks;  // after index and match
};

const std::array<MatchKernel, match_pass_count> match_kernels{{
    {"match_blur", {}},
    {"match_field", {"match.field"}},
    {"match_grow", {"match.field"}},
    {"match_sample", {"match.field"}},
    {"match_sample", {"match.still"}},
    {"match_difference", {"match.octahedron"}},
    {"match_mean", {}},
    {"match_distance", {"match.octahedron", "match.patch", "match.smoothed"}},
    {"match_smooth", {"match.patch", "match.distance", "match.smoothed"}},
    {"match_erode", {}},
    {"match_describe", {"match.octahedron", "match.distance"}},
    {"match_forces", {"match.cells"}},
    {"match_window", {"match.cells"}},
    {"match_solve", {"match.cells"}},
    {"match_look", {"match.block"}},
    {"match_walk", {"match.block"}},
    {"match_echo_bricks", {"match.echo", "match.echo.linear"}},
    {"match_echo_window", {"match.echo", "match.echo.linear"}},
    {"match_echo_costs", {"match.echo", "match.echo.linear"}},
    {"match_echo_bricks", {"match.echo", "match.echo.structure"}},
    {"match_echo_window", {"match.echo", "match.echo.structure"}},
    {"match_echo_costs", {"match.echo", "match.echo.structure"}},
}};

}  // namespace

ProgramSource element_force_program(const ElementForces& forces) {
    ProgramSource source{
        "element_force",
        {"index", "bindings", "numbers", "deformation", "element", "material", "isochoric.first", "isochoric"},
        {},
        {}};
    if (has_fibres(forces.law)) source.chunks.emplace_back("element.fibre");
    add_law(source, forces.law);
    const bool viscous = forces.viscosity != Viscosity::None;
    source.defines = {{"WORKGROUP_SIZE", workgroup_size}, {"USES_SHEAR", "1"}, {"HAS_VISCOSITY", flag(viscous)}};
    if (viscous) {
        source.chunks.emplace_back("viscosity");
        source.chunks.emplace_back("viscosity.prony");
        source.defines["PRONY_TERMS"] = unsigned_number(forces.prony_terms);
        source.defines["ADVANCES_TIME"] = flag(forces.viscosity == Viscosity::Advance);
    }
    if (forces.pressure == PressureRule::Element) {
        source.chunks.emplace_back("pressure.element");
    } else {
        source.chunks.emplace_back("pressure.averaged");
        source.defines["HAS_ELEMENT_PRESSURE"] = flag(forces.pressure == PressureRule::AveragedWithElementPart);
    }
    return source;
}

ProgramSource element_volume_program() {
    return {
        "element_volume", {"index", "bindings", "deformation", "element"}, {{"WORKGROUP_SIZE", workgroup_size}}, {}};
}

ProgramSource nodal_pressure_program(Law law) {
    ProgramSource source{"nodal_pressure", {"index", "bindings", "numbers"}, {}, {}};
    source.defines = {{"WORKGROUP_SIZE", workgroup_size}, {"USES_SHEAR", "0"}};
    add_law(source, law);
    return source;
}

ProgramSource surface_force_program(const SurfaceForces& forces) {
    ProgramSource source{"surface_force", {"index", "bindings", "surface"}, {{"WORKGROUP_SIZE", workgroup_size}}, {}};
    add_effect(source, "surface.pressure", "HAS_PRESSURE", forces.pressure);
    add_effect(source, "surface.membrane", "HAS_MEMBRANE", forces.membrane);
    add_effect(source, "surface.sliding", "HAS_SLIDING", forces.sliding);
    add_effect(source, "surface.parting", "HAS_PARTING", forces.parting);
    return source;
}

ProgramSource node_step_program(const NodeEffects& effects, StoreResidual store) {
    ProgramSource source = node_program("node_step", effects);
    add_contact(source, effects, "node.settle");
    source.defines["STORES_RESIDUAL"] = flag(store == StoreResidual::Yes);
    return source;
}

ProgramSource node_residual_program(const NodeEffects& effects, MaskConstrained mask) {
    ProgramSource source = node_program("node_residual", effects);
    source.defines["MASKS_CONSTRAINED"] = flag(mask == MaskConstrained::Yes);
    return source;
}

bool has_fibres(Law law) {
    return law == Law::TransverselyIsotropic;
}

ProgramSource patch_step_program(const PatchTissue& tissue, const NodeEffects& effects, const PatchSizes& sizes,
                                 const PatchStages& stages) {
    ProgramSource source{"patch_step", {"index", "bindings", "numbers"}, {}, {}};
    const auto add = [&](const char* chunk) { source.chunks.emplace_back(chunk); };
    const auto define = [&](const char* name, const std::string& value) { source.defines[name] = value; };
    if (stages.forces)
        for (const char* chunk : {"deformation", "material",
                                  gives_second(tissue.law) ? "isochoric.second" : "isochoric.first", "isochoric"})
            add(chunk);
    if (stages.forces || stages.averages) {
        add_law(source, tissue.law);
        define("USES_SHEAR", flag(stages.forces));
    }
    add_nodal_forces(source, effects);
    for (const char* chunk : {"patch", "patch.state"}) add(chunk);
    if (effects.springs || effects.external_force || effects.fluid || effects.contact) add("patch.node");
    add_contact(source, effects, "patch.contact");
    for (const char* chunk : {"patch.exchange", "patch.nodes", "patch.units", "patch.fans"}) add(chunk);
    if (stages.averages) add("patch.pressure.averaged");
    const bool stays = stages.persists && sizes.each_has_one;
    if (stages.forces) {
        if (!stages.averages) add("patch.pressure.element");
        add_patch_forces(source, tissue, sizes, stages);
    }
    if (stages.persists) add("patch.neighbours");
    define("WORKGROUP_SIZE", std::to_string(sizes.workgroup));
    define("ADVANCES", flag(stages.advances));
    define("VOLUMES", flag(stages.volumes));
    define("FORCES", flag(stages.forces));
    define("AVERAGES", flag(stages.averages));
    define("PERSISTS", flag(stages.persists));
    define("STAYS", flag(stays));
    define("STRESSES_STAY", flag(places_of_stresses(tissue, sizes, stages) > 0));
    define("COHERENT", stages.persists ? "coherent" : "");
    define("SLOTS", std::to_string(sizes.slots) + "u");
    return source;
}

ProgramSource patch_load_program() {
    return {"patch_load", {"index", "bindings"}, {{"WORKGROUP_SIZE", workgroup_size}}, {}};
}

ProgramSource patch_store_program() {
    return {"patch_store", {"index", "bindings"}, {{"WORKGROUP_SIZE", workgroup_size}}, {}};
}

ProgramSource patch_stress_program(const PatchTissue& tissue, PatchStresses what) {
    return {"patch_stress",
            {"index", "bindings"},
            {{"WORKGROUP_SIZE", workgroup_size},
             {"PRONY_TERMS", unsigned_number(tissue.prony_terms)},
             {"HAS_FIBRES", flag(has_fibres(tissue.law))},
             {"LOADS", flag(what == PatchStresses::Load)},
             {"SUMS", flag(what == PatchStresses::Sum)}},
            {}};
}

ProgramSource impose_program() {
    return {"impose", {"index", "bindings"}, {{"WORKGROUP_SIZE", workgroup_size}}, {}};
}

ProgramSource previous_displacement_program() {
    return {"previous_displacement", {"index", "bindings"}, {{"WORKGROUP_SIZE", workgroup_size}}, {}};
}

ProgramSource observe_nodes_program() {
    return {"observe_nodes",
            {"index", "bindings", "numbers"},
            {{"WORKGROUP_SIZE", observe_workgroup_size}, {"PARTIALS", std::to_string(observe_partials) + "u"}},
            {}};
}

ProgramSource observe_elements_program() {
    ProgramSource source = observe_nodes_program();
    source.kernel = "observe_elements";
    source.chunks.emplace_back("deformation");
    source.chunks.emplace_back("element");
    return source;
}

ProgramSource warp_clear_program() {
    return warp_program("warp_clear");
}

ProgramSource warp_elements_program() {
    ProgramSource source = warp_program("warp_elements");
    source.chunks.emplace_back("warp.element");
    return source;
}

ProgramSource warp_rasterise_program() {
    ProgramSource source = warp_elements_program();
    source.kernel = "warp_rasterise";
    source.defines["PORTION_LANES"] = std::to_string(warp_portion_lanes) + "u";
    return source;
}

ProgramSource warp_image_program(WarpContinuation continuation, WarpTakes takes) {
    ProgramSource source = warp_program("warp_image", continuation);
    source.defines["TAKES_NEAREST"] = flag(takes == WarpTakes::Nearest);
    return source;
}

ProgramSource warp_field_program(WarpContinuation continuation) {
    return warp_program("warp_field", continuation);
}

ProgramSource match_program(MatchPass pass, int descriptor_reach) {
    const MatchKernel& match = match_kernels[static_cast<std::size_t>(pass)];
    ProgramSource source{match.kernel, {"index", "match"}, {{"WORKGROUP_SIZE", workgroup_size}}, {}};
    source.chunks.insert(source.chunks.end(), match.chunks.begin(), match.chunks.end());
    const auto number = [](int n) { return std::to_string(n) + "u"; };
    if (pass == MatchPass::Difference) source.defines["PARTIALS"] = number(match_partials);
    if (pass == MatchPass::Mean) source.defines["WORKGROUP_SIZE"] = std::to_string(match_partials);
    if (pass == MatchPass::Erode) source.defines["DESCRIPTOR_REACH"] = number(descriptor_reach);
    if (pass == MatchPass::Walk) {
        source.defines["MOST_STEPS"] = number(match_walk_steps);
        source.defines["MOST_CANDIDATES"] = number(match_most_candidates);
        source.defines["CANDIDATES_ONE_OF"] = number(match_candidates_one_of);
        source.defines["WORKGROUP_SIZE"] = "256";  // an invocation for each column of a block, and more
    }
    if (pass == MatchPass::Forces) {
        source.defines["CELL_SIDE"] = number(match_cell_side);
        source.defines["WORKGROUP_SIZE"] = std::to_string(match_cell_side * match_cell_side * match_cell_side);
    }
    return source;
}

ProgramSource copy_bandwidth_program() {
    return {"copy_bandwidth", {"index", "bindings"}, {{"WORKGROUP_SIZE", workgroup_size}}, {}};
}

ProgramSource fma_rate_program() {
    return {"fma_rate",
            {"index", "bindings"},
            {{"WORKGROUP_SIZE", workgroup_size}, {"FMA_PER_ROUND", std::to_string(fma_per_round)}},
            {}};
}

ProgramSource full_screen_vertices() {
    return {"full_screen", {}, {}, {}, ShaderStage::Vertex};
}

ProgramSource element_forces_pass(Law law) {
    ProgramSource source{
        "element_forces",
        {"numbers", "texels", "deformation", "element.textures", "material.textures", "isochoric.first", "isochoric"},
        {{"USES_SHEAR", "1"}},
        {},
        ShaderStage::Fragment};
    add_law(source, law);
    source.chunks.emplace_back("pressure.element");
    return source;
}

ProgramSource node_step_pass() {
    return {"node_step", {"texels"}, {}, {}, ShaderStage::Fragment};
}

}  // namespace tissuewarp::shaders
