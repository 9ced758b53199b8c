#include "tled/gpu/gpu_effects.hpp"

#include "core/errors.hpp"

#include <string>

namespace tissuewarp::tled::detail {
namespace {

/// Conditions that change as time goes on mostly keep their sizes, and a new buffer costs more than what goes into it.
template <class T>
void put(std::optional<shaders::Buffer<T>>& buffer, const shaders::Device& device, const std::vector<T>& values,
         const char* what) {
    if (buffer && buffer->size() == values.size()) return buffer->upload(values);
    buffer.reset();
    buffer.emplace(device, values, what);
}

}  // namespace

GpuEffects::GpuEffects(const shaders::Device& device, shaders::ProgramCache& programs, const RestState& rest)
    : device_(device), programs_(programs), position_(rest.position) {}

void GpuEffects::set(const NodalConditions& conditions, BlockBuffers& blocks) {
    set_springs(conditions, blocks);
    set_external_force(conditions.external_force, blocks);
    set_surface(conditions.effects.surface, blocks);
    set_fluid(conditions.effects.fluid, blocks);
    set_contact(conditions.effects.contact, blocks);
    on_nodes_ = {.springs = springs_.has_value(),
                 .external_force = external_force_.has_value(),
                 .surface_force = surface_.has_value(),
                 .fluid = fluid_.has_value(),
                 .contact = contact_.has_value(),
                 .turning = contact_ && turns(conditions.effects.contact->obstacles)};
}

void GpuEffects::set_springs(const NodalConditions& conditions, BlockBuffers& blocks) {
    if (conditions.spring_node.empty()) return springs_.reset();
    put(springs_, device_, gpu_springs(conditions, static_cast<int>(position_.cols())), "springs");
    blocks.set("Springs", *springs_);
}

void GpuEffects::set_external_force(const Eigen::Matrix3Xd& force, BlockBuffers& blocks) {
    if (force.size() == 0 || force.isZero(0.0)) return external_force_.reset();
    if (force.cols() != position_.cols())
        throw InvalidInput("the external force has " + std::to_string(force.cols()) + " columns; the model has " +
                           std::to_string(position_.cols()) + " nodes");
    put(external_force_, device_, packed(force), "external forces");
    blocks.set("ExternalForce", *external_force_);
}

void GpuEffects::set_surface(const SurfaceEffects& effects, BlockBuffers& blocks) {
    surface_pass_.reset();
    if (effects.empty()) return surface_.reset();
    const GpuSurface layout = gpu_surface(effects, position_);
    if (surface_ && surface_->node == effects.node && surface_->words.size() == layout.words.size()) {
        surface_->words.upload(layout.words);
    } else {
        surface_.reset();
        surface_.emplace(device_, layout, effects.node, static_cast<std::size_t>(position_.cols()));
    }
    blocks.set("SurfaceEffects", surface_->words);
    blocks.set("SurfaceForce", surface_->force);
    const shaders::SurfaceForces forces{.pressure = layout.pressure_lists > 0,
                                        .membrane = layout.membrane_lists > 0,
                                        .sliding = layout.sliding_lists > 0,
                                        .parting = layout.parting_lists > 0};
    const shaders::Program& program = programs_.get(shaders::surface_force_program(forces));
    program.set(0, static_cast<std::uint32_t>(effects.node.size()));
    if (forces.pressure) program.set(1, layout.pressure_lists);
    if (forces.membrane) program.set(2, layout.membrane_lists);
    if (forces.sliding) program.set(3, layout.sliding_lists);
    if (forces.parting) program.set(4, layout.parting_lists);
    surface_pass_ = Pass{&program, effects.node.size()};
}

void GpuEffects::set_fluid(const std::optional<NodalFluid>& fluid, BlockBuffers& blocks) {
    if (!fluid) return fluid_.reset();
    put(fluid_, device_, gpu_fluid(*fluid), "columns of the fluid");
    blocks.set("Fluid", *fluid_);
}

void GpuEffects::set_contact(const std::optional<NodalContact>& contact, BlockBuffers& blocks) {
    if (!contact) return contact_.reset();
    std::vector<SharedGrid> grids;
    for (const Obstacle& obstacle : contact->obstacles) grids.push_back(obstacle.surface);
    const int node_count = static_cast<int>(position_.cols());
    if (contact_ && contact_->node == contact->node && contact_->grids == grids)
        return contact_->words.upload(gpu_obstacles(*contact, node_count));
    contact_.reset();
    contact_.emplace(
        Contact{{device_, gpu_contact(*contact, node_count), "obstacles"}, contact->node, std::move(grids)});
    blocks.set("Contact", contact_->words);
}

void GpuEffects::set_time_step(const shaders::Program& program, double time_step) const {
    if (contact_) program.set(15, static_cast<float>(time_step));
}

void GpuEffects::bind(const BlockBuffers& blocks) const {
    if (surface_pass_) blocks.bind(*surface_pass_->program);
}

void GpuEffects::dispatch() const {
    if (surface_pass_) surface_pass_->program->dispatch(surface_pass_->invocations);
}

}  // namespace tissuewarp::tled::detail
