#include "tled/gpu/gpu_observation.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tissuewarp::tled::detail {

namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();

void reduce(const shaders::Program& program, BlockBuffers& blocks, const shaders::StorageBuffer& partials) {
    blocks.set("Partial", partials);
    blocks.bind(program);
    program.dispatch(static_cast<std::size_t>(shaders::observe_partials * program.workgroup_size()));
    shaders::storage_barrier();
}

}  // namespace

GpuObservation::GpuObservation(const shaders::Device& device, shaders::ProgramCache& programs, const RestState& rest)
    : programs_(programs),
      tet_(rest.tet),
      node_partials_(device, shaders::observe_partials, "partial results of nodes"),
      element_partials_(device, shaders::observe_partials, "partial results of elements") {}

Observation GpuObservation::nodes(const shaders::Program& program, BlockBuffers& blocks) const {
    reduce(program, blocks, node_partials_);
    Observation seen;
    double increment_squared = 0;
    double residual_squared = 0;
    std::uint64_t bad_displacements = 0;
    std::uint64_t bad_residuals = 0;
    for (const NodePartial& part : node_partials_.download()) {
        increment_squared = std::max(increment_squared, static_cast<double>(part.increment_squared_max));
        residual_squared = std::max(residual_squared, static_cast<double>(part.residual_squared_max));
        seen.increment_mass += static_cast<double>(part.increment_mass);
        seen.increment_stiffness += static_cast<double>(part.increment_stiffness);
        bad_displacements += part.bad_displacements;
        bad_residuals += part.bad_residuals;
    }
    seen.increment_max = bad_displacements > 0 ? infinite : std::sqrt(increment_squared);
    seen.residual_max = bad_displacements + bad_residuals > 0 ? infinite : std::sqrt(residual_squared);
    seen.finite = bad_displacements + bad_residuals == 0;
    return seen;
}

SmallestJacobian GpuObservation::smallest_jacobian(const GpuForce& force, BlockBuffers& blocks) const {
    reduce_elements(force, blocks);
    const std::vector<ElementPartial> partials = element_partials_.download();
    return smallest_of(std::as_bytes(std::span(partials)));
}

const shaders::StorageBuffer& GpuObservation::reduce_elements(const GpuForce& force, BlockBuffers& blocks) const {
    const shaders::Program& elements = programs_.get(shaders::observe_elements_program());
    force.set_all_elements(elements);
    reduce(elements, blocks, element_partials_);
    return element_partials_;
}

SmallestJacobian GpuObservation::smallest_of(std::span<const std::byte> partials) const {
    float least = std::numeric_limits<float>::max();
    std::uint32_t element = std::numeric_limits<std::uint32_t>::max();
    const std::span parts(reinterpret_cast<const ElementPartial*>(partials.data()),
                          partials.size() / sizeof(ElementPartial));
    for (const ElementPartial& part : parts)
        if (part.volume_change < least || (part.volume_change == least && part.element < element)) {
            least = part.volume_change;
            element = part.element;
        }
    if (element == std::numeric_limits<std::uint32_t>::max()) return {-infinite};  // no J is finite
    return {1.0 + static_cast<double>(least), tet_[element]};
}

}  // namespace tissuewarp::tled::detail
