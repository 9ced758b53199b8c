#include "tled/gpu/gpu_patches.hpp"

#include "tled/gpu/step_shapes.hpp"

#include <algorithm>
#include <array>
#include <cstring>

namespace tissuewarp::tled::detail {
namespace {

using shaders::PatchStages;
using shaders::Program;

/// Recorded steps are handed over in portions of this many, so that the device starts while the host still records.
constexpr int steps_per_flush = 64;
constexpr int steps_per_dispatch = 500;
/// Of shaders/chunks/patch.state.glsl, and of patch.contact.glsl for each obstacle.
constexpr std::size_t state_planes = 6, tangent_planes = 8;

/// Patches are of one material: these meet at a node whatever their size.
bool too_many_materials_meet(const RestState& rest) {
    const std::vector<int> material = material_of_elements(rest);
    std::vector<int> here;
    for (std::size_t a = 0; a + 1 < rest.incidence.offset.size(); ++a) {
        here.clear();
        for (int i = rest.incidence.offset[a]; i < rest.incidence.offset[a + 1]; ++i)
            here.push_back(material[static_cast<std::size_t>(rest.incidence.entry[static_cast<std::size_t>(i)] / 4)]);
        std::sort(here.begin(), here.end());
        const auto kinds = std::unique(here.begin(), here.end()) - here.begin();
        if (static_cast<std::size_t>(kinds) > most_sharing_patches) return true;
    }
    return false;
}

/// Whether elements keep a part of an averaged pressure.
bool keeps_a_part(const RestState& rest) {
    return rest.pressure.count() > 0 && rest.volumetric_modulus.cwiseAbs().maxCoeff() > 0;
}

/// Most storage blocks of the patches' programs.
int storage_blocks(bool averages, bool tissue, const shaders::NodeEffects& effects) {
    return 10 + int{averages} + int{tissue} + int{effects.springs} + int{effects.external_force} + int{effects.fluid} +
           int{effects.contact};
}

/// Bytes of shared memory that the patches' programs take.
std::size_t shared_bytes(std::size_t slots, bool averages) {
    return slots * (averages ? 44 : 36) + 16;
}

std::size_t most_slots(const std::vector<Patch>& patches) {
    std::size_t most = 0;
    for (const Patch& patch : patches) most = std::max(most, patch.node.size());
    return slots_for(most);
}

/// Patches that do not fit into shared memory shrink, such that their number grows by halves: what was shared out
/// evenly among multiprocessors stays so. Patches that are so tiny that too many meet at a node grow.
PatchLayout fitting_layout(const RestState& rest, const GpuStepShape& shape, std::size_t shared_memory) {
    const int elements = rest.element_count(), asked = std::min(shape.patch_tets, elements);
    const int count = (elements + asked - 1) / asked;
    std::vector<Patch> patches = cut_into_patches(rest, {asked, shape.longest_fan});
    for (int halves = 3; shared_bytes(most_slots(patches), rest.pressure.count() > 0) > shared_memory; ++halves)
        patches = cut_into_patches(rest, {(2 * elements + halves * count - 1) / (halves * count), shape.longest_fan});
    for (int tets = 2 * asked; most_sharing(rest.node_count, patches) > most_sharing_patches; tets *= 2)
        patches = cut_into_patches(rest, {tets, shape.longest_fan});
    return patch_layout(rest, patches);
}

/// Places that a patch has in shared memory for viscous stresses, in steps as slots have them; 0 where all workgroups
/// of a multiprocessor together have no room for these beside their nodes.
int places_that_stay(const TissueOfPatches& tissue, const PatchCapacity& capacity, bool averages, int workgroups,
                     const shaders::DeviceLimits& limits) {
    if (!tissue.viscous()) return 0;
    const std::size_t places = slots_for(static_cast<std::size_t>(capacity.longest_fan * capacity.fans));
    const int multiprocessors = limits.multiprocessors > 0 ? limits.multiprocessors : default_multiprocessors;
    const auto side_by_side = static_cast<std::size_t>((workgroups + multiprocessors - 1) / multiprocessors);
    const std::size_t bytes =
        shared_bytes(static_cast<std::size_t>(capacity.slots), averages) + tissue.stress_bytes(places);
    return side_by_side * bytes <= limits.shared_memory_bytes ? static_cast<int>(places) : 0;
}

constexpr std::array<PatchStages, 1> first_forces{{{.forces = true}}};
constexpr std::array<PatchStages, 1> one_step{{{.advances = true, .forces = true}}};
constexpr std::array<PatchStages, 1> many_steps{{{.advances = true, .forces = true, .persists = true}}};
constexpr std::array<PatchStages, 1> last_step{{{.advances = true}}};
constexpr std::array<PatchStages, 2> averaged_first_forces{
    {{.volumes = true, .averages = true}, {.forces = true, .averages = true}}};
constexpr std::array<PatchStages, 2> averaged_one_step{
    {{.advances = true, .volumes = true, .averages = true}, {.forces = true, .averages = true}}};
constexpr std::array<PatchStages, 1> averaged_many_steps{
    {{.advances = true, .volumes = true, .forces = true, .averages = true, .persists = true}}};

std::vector<PatchStages> with_stresses(std::span<const PatchStages> stages, bool rest) {
    std::vector<PatchStages> all(stages.begin(), stages.end());
    for (PatchStages& each : all) each.rests = rest;
    return all;
}

int count_of(const std::vector<StressSteps>& steps) {
    int count = 0;
    for (const StressSteps& each : steps) count += each.count;
    return count;
}

}  // namespace

bool GpuPatches::suit(const RestState& rest, const shaders::Device& device) {
    const bool tissue = rest.fibre.cols() > 0 || !rest.viscosity.empty();
    if (keeps_a_part(rest) || device.limits().storage_blocks < storage_blocks(rest.pressure.count() > 0, tissue, {}))
        return false;
    const auto follows_the_law = [&](const MaterialBlock& block) {
        return rest.materials[static_cast<std::size_t>(block.material)].index() ==
               static_cast<std::size_t>(law_of(rest));
    };
    return std::all_of(rest.blocks.begin(), rest.blocks.end(), follows_the_law) && !too_many_materials_meet(rest);
}

GpuPatches::GpuPatches(const shaders::Device& device, shaders::ProgramCache& programs, const RestState& rest,
                       const GpuStepShape& shape, BlockBuffers& blocks)
    : device_(device),
      programs_(programs),
      shape_(shape),
      averages_(rest.pressure.count() > 0),
      storage_blocks_(device.limits().storage_blocks),
      node_count_(static_cast<std::size_t>(rest.node_count)) {
    const PatchLayout layout = fitting_layout(rest, shape, device.limits().shared_memory_bytes);
    const PatchCapacity& c = layout.capacity;
    workgroups_ = shape.at_once > 0 ? std::min(shape.at_once, c.patches) : c.patches;
    many_steps_ = shape.at_once > 0;
    capacity_ = c;
    tissue_.emplace(device, rest, layout, blocks);
    sizes_ = {c.slots, shape.workgroup, workgroups_ == c.patches};
    if (many_steps_ && sizes_.each_has_one)
        sizes_.places = places_that_stay(*tissue_, c, averages_, workgroups_, device.limits());
    slot_count_ = layout.node_of_slot.size();
    std::vector<Uint4> head = layout.head;
    head.insert(head.end(), layout.fans.begin(), layout.fans.end());
    head_.emplace(device, head, "heads and fans of patches");
    rest_.emplace(device, layout.rest, "rest data of patches");
    state_.emplace(device, state_planes * slot_count_, "state of patches");
    sources_.emplace(device, layout.sources, "sources of forces");
    neighbours_.emplace(device, layout.neighbours, "neighbours of patches");
    progress_.emplace(device, static_cast<std::size_t>(c.patches) + 1, "progress of patches");
    largest_.emplace(device, static_cast<std::size_t>(c.patches), "largest forces of patches");
    volumes_.emplace(device, averages_ ? slot_count_ + 1 : 1, "volume changes of patches");
    node_of_slot_.emplace(device, layout.node_of_slot, "nodes of slots");
    slot_of_node_.emplace(device, layout.slot_of_node, "slots of nodes");
    forces_.emplace(device, 2 * slot_count_ + 1, "forces of patches");
    blocks.set("PatchHead", *head_);
    blocks.set("PatchRest", *rest_);
    blocks.set("PatchState", *state_);
    blocks.set("PatchSources", *sources_);
    blocks.set("PatchNeighbours", *neighbours_);
    blocks.set("PatchProgress", *progress_);
    blocks.set("PatchLargest", *largest_);
    blocks.set("PatchNode", *node_of_slot_);
    blocks.set("PatchSlot", *slot_of_node_);
    blocks.set("PatchForces", *forces_);
    blocks.set("PatchVolumes", *volumes_);
}

void GpuPatches::set_obstacles(std::size_t count, BlockBuffers& blocks) {
    obstacles_ = count;
    const std::size_t planes = state_planes + tangent_planes * count;
    if (state_->size() == planes * slot_count_) return;
    state_.emplace(device_, planes * slot_count_, "state of patches");
    blocks.set("PatchState", *state_);
    forget_state();
}

bool GpuPatches::take(const shaders::NodeEffects& effects) const {
    return !effects.surface_force && storage_blocks(averages_, !tissue_->empty(), effects) <= storage_blocks_;
}

void GpuPatches::run(const std::vector<GpuSteps>& steps, const shaders::NodeEffects& effects,
                     const BlockBuffers& blocks) {
    for (const auto& [parts, coefficients] : steps) take_steps(parts, coefficients, effects, blocks);
    store(blocks);
    shaders::check_errors("time steps over patches");
}

void GpuPatches::take_one_by_one() {
    many_steps_ = false;
    progress_->clear();
    forget_state();
}

GpuPatches::Run GpuPatches::next_steps(int steps, const StepCoefficients& coefficients) const {
    return {step_, step_ + static_cast<std::uint32_t>(steps), coefficients};
}

void GpuPatches::take_steps(const std::vector<StressSteps>& steps, const StepCoefficients& coefficients,
                            const shaders::NodeEffects& effects, const BlockBuffers& blocks) {
    if (tissue_->viscous())
        take_viscous_steps(steps, coefficients, effects, blocks);
    else
        take_elastic_steps(count_of(steps), coefficients, effects, blocks);
}

/// The forces that the first step starts from are those that the run before ended with.
void GpuPatches::take_elastic_steps(int steps, const StepCoefficients& coefficients,
                                    const shaders::NodeEffects& effects, const BlockBuffers& blocks) {
    if (!loaded_) {
        load(blocks);
        dispatch(stages_of_first_forces(), 1, 1, next_steps(1, {}), effects, blocks);
    }
    dispatch_steps(stages_of_a_step(), steps, next_steps(steps, coefficients), effects, blocks);
}

/// Forces move viscous stresses on: those of the first step are computed before it, and none after the last.
void GpuPatches::take_viscous_steps(const std::vector<StressSteps>& steps, const StepCoefficients& coefficients,
                                    const shaders::NodeEffects& effects, const BlockBuffers& blocks) {
    if (!loaded_) load(blocks);
    std::optional<Run> run;
    for (const auto& [count, interval] : steps) {
        const bool rest = interval == 0;
        if (rest)
            tissue_->sum_stresses(programs_, blocks);
        else
            tissue_->set_stress_interval(interval);
        const int forces_known = run ? 0 : 1;
        if (!run) {
            dispatch(with_stresses(stages_of_first_forces(), rest), 1, 1, next_steps(1, {}), effects, blocks);
            run = next_steps(count_of(steps), coefficients);
        }
        dispatch_steps(with_stresses(stages_of_a_step(), rest), count - forces_known, *run, effects, blocks);
    }
    dispatch(last_step, 1, 1, *run, effects, blocks);
}

void GpuPatches::dispatch_steps(Stages stages, int steps, const Run& run, const shaders::NodeEffects& effects,
                                const BlockBuffers& blocks) {
    if (!many_steps_) return dispatch(stages, steps, 1, run, effects, blocks);
    dispatch(stages, steps / steps_per_dispatch, steps_per_dispatch, run, effects, blocks);
    if (const int left = steps % steps_per_dispatch; left > 0) dispatch(stages, 1, left, run, effects, blocks);
}

GpuPatches::Stages GpuPatches::stages_of_first_forces() const {
    return averages_ ? Stages(averaged_first_forces) : first_forces;
}

GpuPatches::Stages GpuPatches::stages_of_a_step() const {
    if (many_steps_) return averages_ ? averaged_many_steps : many_steps;
    return averages_ ? Stages(averaged_one_step) : one_step;
}

std::vector<Pass> GpuPatches::passes(const shaders::NodeEffects& effects) const {
    std::vector<Pass> result;
    for (const PatchStages& each : stages_of_a_step())
        result.push_back({&programs_.get(shaders::patch_step_program(tissue_->kind(), effects, sizes_, each)),
                          static_cast<std::size_t>(workgroups_of(each)) * static_cast<std::size_t>(sizes_.workgroup)});
    return result;
}

int GpuPatches::workgroups_of(const PatchStages& stages) const {
    return stages.persists ? workgroups_ : capacity_.patches;
}

/// The uniforms of shaders/chunks/patch.glsl and patch.contact.glsl.
void GpuPatches::set_sizes(const Program& program, int workgroups) const {
    const auto set = [&](int location, auto value) { program.set(location, static_cast<std::uint32_t>(value)); };
    set(6, capacity_.patches);
    set(7, slot_count_);
    set(8, capacity_.fans);
    set(9, capacity_.sources);
    set(10, capacity_.neighbours);
    set(11, workgroups);
    program.set(12, static_cast<float>(capacity_.contributions));
    if (obstacles_ > 0) set(14, obstacles_);
}

void GpuPatches::dispatch(Stages stages, int repeats, int steps, const Run& run, const shaders::NodeEffects& effects,
                          const BlockBuffers& blocks) {
    std::vector<const Program*> programs;
    for (const PatchStages& each : stages) {
        programs.push_back(&programs_.get(shaders::patch_step_program(tissue_->kind(), effects, sizes_, each)));
        blocks.bind(*programs.back());
        programs.back()->set(1, static_cast<float>(run.coefficients.momentum));
        programs.back()->set(2, static_cast<float>(run.coefficients.gain));
        programs.back()->set(3, static_cast<std::uint32_t>(steps));
        programs.back()->set(4, run.begin);
        programs.back()->set(5, run.end);
        if (obstacles_ > 0) programs.back()->set(15, static_cast<float>(run.coefficients.time_step));
        set_sizes(*programs.back(), workgroups_of(each));
        if (each.forces) tissue_->set_places(*programs.back());
    }
    const int workgroups = workgroups_of(stages.front());
    for (int i = 1; i <= repeats; ++i) {
        for (const Program* program : programs) {
            program->set(0, step_);
            program->dispatch(static_cast<std::size_t>(workgroups) * static_cast<std::size_t>(sizes_.workgroup));
            shaders::storage_barrier();
        }
        step_ += static_cast<std::uint32_t>(steps);
        if (i % steps_per_flush == 0) shaders::flush();
    }
}

/// State from nodes and elements to patches.
void GpuPatches::load(const BlockBuffers& blocks) {
    loaded_ = true;
    largest_->clear();
    forget_tangents();
    const Program& load = programs_.get(shaders::patch_load_program());
    blocks.bind(load);
    load.dispatch(slot_count_);
    shaders::storage_barrier();
    tissue_->load_stresses(programs_, blocks);
}

/// Of every slot and obstacle the reach, the first of their planes: with 0 the next step looks.
void GpuPatches::forget_tangents() {
    if (obstacles_ == 0) return;
    const std::vector<float> none(slot_count_);
    for (std::size_t o = 0; o < obstacles_; ++o)
        state_->upload(none, (state_planes + tangent_planes * o) * slot_count_);
}

/// What was bound before stays where a patch gave up: the state is then not that of any step.
void GpuPatches::store(const BlockBuffers& blocks) {
    if (tissue_->viscous() && gave_up()) return;
    const Program& store = programs_.get(shaders::patch_store_program());
    store.set(0, static_cast<std::uint32_t>(node_count_));
    store.set(1, static_cast<std::uint32_t>(slot_count_));
    store.set(2, static_cast<std::uint32_t>(capacity_.patches));
    blocks.bind(store);
    store.dispatch(node_count_);
    shaders::storage_barrier();
    tissue_->store_stresses(programs_, blocks);
}

GpuStepShape GpuPatches::shape() const {
    GpuStepShape shape = shape_;
    if (!many_steps_) shape.at_once = 0;
    return shape;
}

bool GpuPatches::gave_up() const {
    if (!many_steps_) return false;
    std::array<std::uint32_t, 1> flag{};
    progress_->download(flag, progress_->size() - 1);
    return flag[0] != 0;
}

bool GpuPatches::gave_up(std::span<const std::byte> progress) const {
    std::uint32_t flag = 0;
    std::memcpy(&flag, progress.data() + progress.size() - sizeof flag, sizeof flag);
    return many_steps_ && flag != 0;
}

}  // namespace tissuewarp::tled::detail
