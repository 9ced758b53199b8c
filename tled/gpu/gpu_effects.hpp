#pragma once
/// What acts on nodes of the GPU engine: springs, forces and effects, each on the device only where the scene has it.
/// Needs the device's context current, except construction.

#include "shaders/buffer.hpp"
#include "shaders/catalogue.hpp"
#include "shaders/program.hpp"
#include "tled/conditions.hpp"
#include "tled/gpu/gpu_effect_layout.hpp"
#include "tled/gpu/gpu_force.hpp"

#include <Eigen/Core>

#include <optional>

namespace tissuewarp::tled::detail {

class GpuEffects {
public:
    GpuEffects(const shaders::Device& device, shaders::ProgramCache& programs, const RestState& rest);

    /// Replaces everything; `blocks` learns of the buffers.
    void set(const NodalConditions& conditions, BlockBuffers& blocks);
    /// What the programs over nodes take.
    [[nodiscard]] const shaders::NodeEffects& on_nodes() const { return on_nodes_; }

    /// Of a program over nodes, s.
    void set_time_step(const shaders::Program& program, double time_step) const;

    void bind(const BlockBuffers& blocks) const;
    /// Leaves the surface forces of whatever is bound as Displacement, where there are any; a barrier must follow.
    void dispatch() const;
    /// The pass that dispatch() runs, where there is one.
    [[nodiscard]] const std::optional<Pass>& surface_pass() const { return surface_pass_; }

private:
    void set_springs(const NodalConditions& conditions, BlockBuffers& blocks);
    void set_external_force(const Eigen::Matrix3Xd& force, BlockBuffers& blocks);
    void set_surface(const SurfaceEffects& effects, BlockBuffers& blocks);
    void set_fluid(const std::optional<NodalFluid>& fluid, BlockBuffers& blocks);
    void set_contact(const std::optional<NodalContact>& contact, BlockBuffers& blocks);

    struct Surface {
        Surface(const shaders::Device& device, const GpuSurface& layout, const std::vector<int>& loaded,
                std::size_t nodes)
            : node(loaded), words(device, layout.words, "surface effects"), force(device, nodes, "surface forces") {}
        std::vector<int> node;  ///< on which forces act; zero on the others
        shaders::Buffer<std::uint32_t> words;
        shaders::Buffer<Float4> force;
    };

    struct Contact {
        shaders::Buffer<std::uint32_t> words;
        std::vector<int> node;
        std::vector<SharedGrid> grids;
    };

    const shaders::Device& device_;
    shaders::ProgramCache& programs_;
    Eigen::Matrix3Xd position_;  ///< 3 × N, mm, at rest
    shaders::NodeEffects on_nodes_;
    std::optional<shaders::Buffer<Float4>> external_force_, fluid_;
    std::optional<Surface> surface_;
    std::optional<shaders::Buffer<std::uint32_t>> springs_;
    std::optional<Contact> contact_;
    std::optional<Pass> surface_pass_;
};

}  // namespace tissuewarp::tled::detail
