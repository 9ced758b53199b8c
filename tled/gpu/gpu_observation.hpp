#pragma once
/// Scalars of the present state, reduced on the device to a partial result per workgroup and merged here.

#include "shaders/buffer.hpp"
#include "shaders/catalogue.hpp"
#include "shaders/program.hpp"
#include "tled/engine.hpp"
#include "tled/gpu/gpu_force.hpp"

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace tissuewarp::tled::detail {

class GpuObservation {
public:
    GpuObservation(const shaders::Device& device, shaders::ProgramCache& programs, const RestState& rest);

    /// Of all nodes, as Displacement, Increment, InverseMass, Residual and PreviousResidual of `blocks` hold them, but
    /// for the smallest J. `program` is observe_nodes_program() with its uniforms.
    [[nodiscard]] Observation nodes(const shaders::Program& program, BlockBuffers& blocks) const;

    /// At the Displacement of `blocks`; −∞ where no J is finite.
    [[nodiscard]] SmallestJacobian smallest_jacobian(const GpuForce& force, BlockBuffers& blocks) const;

    /// The same in two parts: what the device is to do and where it leaves its results, and what they say.
    const shaders::StorageBuffer& reduce_elements(const GpuForce& force, BlockBuffers& blocks) const;
    [[nodiscard]] SmallestJacobian smallest_of(std::span<const std::byte> partials) const;

private:
    /// What shaders/kernels/observe_nodes.comp leaves per workgroup.
    struct NodePartial {
        float increment_squared_max, residual_squared_max, increment_mass, increment_stiffness;
        std::uint32_t bad_displacements, bad_residuals;
    };
    /// What shaders/kernels/observe_elements.comp leaves per workgroup.
    struct ElementPartial {
        float volume_change;
        std::uint32_t element;
    };
    shaders::ProgramCache& programs_;
    std::vector<int> tet_;
    shaders::Buffer<NodePartial> node_partials_;
    shaders::Buffer<ElementPartial> element_partials_;
};

}  // namespace tissuewarp::tled::detail
