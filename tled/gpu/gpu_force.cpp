#include "tled/gpu/gpu_force.hpp"

#include "tled/material/prony_coefficients.hpp"

#include <stdexcept>

namespace tissuewarp::tled::detail {
namespace {

using shaders::Law;

template <Law law, class Struct>
constexpr bool same_place = std::is_same_v<std::variant_alternative_t<static_cast<std::size_t>(law), Material>, Struct>;
static_assert(std::variant_size_v<Material> == shaders::law_count, "a new law needs its chunk");
static_assert(same_place<Law::NeoHookeanIso, NeoHookeanIso> && same_place<Law::NeoHookeanLnJ, NeoHookeanLnJ> &&
              same_place<Law::NeoHookeanStable, NeoHookeanStable> && same_place<Law::Polynomial, Polynomial> &&
              same_place<Law::ArrudaBoyce, ArrudaBoyce> && same_place<Law::Ogden, Ogden> &&
              same_place<Law::TransverselyIsotropic, TransverselyIsotropic>);

/// Runs of blocks whose materials follow one law: one dispatch each.
struct LawRun {
    Law law;
    int begin, end;
};

std::vector<LawRun> law_runs(const RestState& rest, const std::vector<MaterialBlock>& blocks) {
    std::vector<LawRun> runs;
    for (const MaterialBlock& block : blocks) {
        const auto law = static_cast<Law>(rest.materials[static_cast<std::size_t>(block.material)].index());
        if (runs.empty() || runs.back().law != law) runs.push_back({law, block.begin, block.begin});
        runs.back().end = block.end;
    }
    return runs;
}

std::uint32_t unsigned_count(std::size_t count) {
    return static_cast<std::uint32_t>(count);
}

/// Range and total, uniforms 0 to 2 of the element and pressure kernels.
Pass ranged(const shaders::Program& program, int begin, int end, std::size_t total) {
    program.set(0, static_cast<std::uint32_t>(begin));
    program.set(1, static_cast<std::uint32_t>(end));
    program.set(2, unsigned_count(total));
    return {&program, static_cast<std::size_t>(end - begin)};
}

}  // namespace

void BlockBuffers::bind(const shaders::Program& program) const {
    for (const shaders::StorageBlock& block : program.storage_blocks()) buffer(block.name).bind(block.binding);
}

const shaders::StorageBuffer& BlockBuffers::buffer(const std::string& block) const {
    const auto found = buffers_.find(block);
    if (found == buffers_.end()) throw std::logic_error("no buffer serves the storage block " + block);
    return *found->second;
}

StepPass step_pass(const Pass& pass, const BlockBuffers& blocks) {
    const std::vector<std::string>& files = pass.program->files();
    StepPass result{files.back(), {files.begin(), files.end() - 1}, {}, pass.invocations};
    for (const shaders::StorageBlock& block : pass.program->storage_blocks())
        result.buffers.push_back({block.name, blocks.bytes(block.name)});
    return result;
}

GpuForce::Pressure::Pressure(const shaders::Device& device, const GpuPressure& layout, std::size_t element_count)
    : volume_change(device, element_count, "volume changes"),
      value(device, layout.rest.size(), "nodal pressures"),
      corners(device, layout.corners, "pressure nodes of elements"),
      rest(device, layout.rest, "rest data of pressure nodes"),
      incidence(device, layout.incidence, "elements of pressure nodes") {}

GpuForce::Viscous::Viscous(const shaders::Device& device, const RestState& rest)
    : series(rest.viscosity),
      terms(most_terms(series)),
      coefficients(device, series.size() * terms, "Prony coefficients"),
      stress(device, 2 * terms * static_cast<std::size_t>(rest.element_count()), "viscous stresses"),
      kept(device, stress.size(), "kept viscous stresses") {
    coefficients.upload(prony_table(series, interval));
}

GpuForce::GpuForce(const shaders::Device& device, shaders::ProgramCache& programs, const RestState& rest,
                   BlockBuffers& blocks)
    : element_count_(static_cast<std::size_t>(rest.element_count())),
      corner_force_(device, 4 * element_count_, "corner forces") {
    const shaders::CurrentContext current = device.make_current();
    {
        const GpuElements layout = gpu_elements(rest);
        materials_.emplace(device, layout.materials, "material parameters");
        if (!layout.fibre.empty()) fibre_.emplace(device, layout.fibre, "fibres");
        nodes_.emplace(device, layout.nodes, "nodes of elements");
        rest_.emplace(device, layout.rest, "rest data of elements");
        incidence_.emplace(device, layout.node_incidence, "corners of nodes");
    }
    blocks.set("ElementNodes", *nodes_);
    blocks.set("ElementRest", *rest_);
    blocks.set("NodeIncidence", *incidence_);
    blocks.set("CornerForce", corner_force_);
    blocks.set("MaterialParameters", *materials_);
    if (fibre_) blocks.set("Fibre", *fibre_);
    std::vector<MaterialBlock> pressure_blocks;
    if (rest.pressure.count() > 0) {
        const GpuPressure layout = gpu_pressure(rest);
        pressure_blocks = layout.blocks;
        pressure_.emplace(device, layout, element_count_);
        blocks.set("VolumeChange", pressure_->volume_change);
        blocks.set("Pressure", pressure_->value);
        blocks.set("PressureCorners", pressure_->corners);
        blocks.set("PressureRest", pressure_->rest);
        blocks.set("PressureIncidence", pressure_->incidence);
    }
    if (!rest.viscosity.empty()) {
        viscous_.emplace(device, rest);
        blocks.set("Prony", viscous_->coefficients);
        blocks.set("ViscousStress", viscous_->stress);
    }
    make_stages(programs, rest, pressure_blocks);
}

void GpuForce::make_stages(shaders::ProgramCache& programs, const RestState& rest,
                           const std::vector<MaterialBlock>& pressure) {
    using shaders::PressureRule;
    PressureRule rule = PressureRule::Element;
    if (!pressure.empty()) {
        rule = rest.volumetric_modulus.cwiseAbs().maxCoeff() > 0 ? PressureRule::AveragedWithElementPart
                                                                 : PressureRule::Averaged;
        pressure_stages_.push_back(
            {ranged(programs.get(shaders::element_volume_program()), 0, rest.element_count(), element_count_)});
        Stage nodal;
        for (const LawRun& run : law_runs(rest, pressure))
            nodal.push_back(ranged(programs.get(shaders::nodal_pressure_program(run.law)), run.begin, run.end,
                                   static_cast<std::size_t>(rest.pressure.count())));
        pressure_stages_.push_back(nodal);
    }
    force_stage_ = force_stage(programs, rest, rule, Advance::No);
    advancing_force_stage_ = force_stage(programs, rest, rule, Advance::Yes);
}

Stage GpuForce::force_stage(shaders::ProgramCache& programs, const RestState& rest, shaders::PressureRule rule,
                            Advance advance) const {
    shaders::ElementForces forces{.pressure = rule};
    if (viscous_) {
        forces.viscosity = advance == Advance::Yes ? shaders::Viscosity::Advance : shaders::Viscosity::Hold;
        forces.prony_terms = static_cast<int>(viscous_->terms);
    }
    // Equal laws are adjacent, so each has one run and its program keeps one range.
    Stage stage;
    for (const LawRun& run : law_runs(rest, rest.blocks)) {
        forces.law = run.law;
        stage.push_back(
            ranged(programs.get(shaders::element_force_program(forces)), run.begin, run.end, element_count_));
    }
    return stage;
}

void GpuForce::set_stress_interval(double interval) {
    if (!viscous_ || viscous_->interval == interval) return;
    viscous_->interval = interval;
    viscous_->coefficients.upload(prony_table(viscous_->series, interval));
}

void GpuForce::forget_viscous_stresses() {
    if (viscous_) viscous_->stress.clear();
}

void GpuForce::bind(const BlockBuffers& blocks) const {
    const auto bind_stage = [&](const Stage& stage) {
        for (const Pass& pass : stage) blocks.bind(*pass.program);
    };
    for (const Stage& stage : pressure_stages_) bind_stage(stage);
    bind_stage(force_stage_);
    bind_stage(advancing_force_stage_);
}

void GpuForce::dispatch(Advance advance) const {
    const auto run = [](const Stage& stage) {
        for (const Pass& pass : stage) pass.program->dispatch(pass.invocations);
        shaders::storage_barrier();
    };
    for (const Stage& stage : pressure_stages_) run(stage);
    run(advance == Advance::Yes ? advancing_force_stage_ : force_stage_);
}

std::vector<Pass> GpuForce::passes() const {
    std::vector<Pass> all;
    for (const Stage& stage : pressure_stages_) all.insert(all.end(), stage.begin(), stage.end());
    all.insert(all.end(), advancing_force_stage_.begin(), advancing_force_stage_.end());
    return all;
}

void GpuForce::keep_viscous_stresses() {
    if (viscous_) viscous_->kept.copy_from(viscous_->stress, viscous_->stress.bytes());
}

void GpuForce::return_to_kept_viscous_stresses() {
    if (viscous_) viscous_->stress.copy_from(viscous_->kept, viscous_->stress.bytes());
}

void GpuForce::set_all_elements(const shaders::Program& program) const {
    ranged(program, 0, static_cast<int>(element_count_), element_count_);
}

}  // namespace tissuewarp::tled::detail
