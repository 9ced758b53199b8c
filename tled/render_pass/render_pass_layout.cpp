#include "tled/render_pass/render_pass_layout.hpp"

namespace tissuewarp::tled::detail {

RenderPassLayout render_pass_layout(const RestState& rest, const RenderPassShapes& shapes) {
    const GpuElements elements = gpu_elements(rest);
    const auto count = static_cast<std::ptrdiff_t>(elements.nodes.size());
    RenderPassLayout layout;
    layout.element_nodes = elements.nodes;
    for (Uint4& nodes : layout.element_nodes)
        for (std::uint32_t& node : nodes) node = shapes.nodes.coordinates(node);
    for (std::size_t k = 0; k < 3; ++k) {
        const auto plane = elements.rest.begin() + static_cast<std::ptrdiff_t>(k) * count;
        layout.rest[k].assign(plane, plane + count);
    }
    layout.materials = elements.materials;
    const Incidence& incidence = rest.incidence;
    for (std::size_t a = 0; a + 1 < incidence.offset.size(); ++a) {
        const auto first = static_cast<std::size_t>(incidence.offset[a]);
        const auto valence = static_cast<std::uint32_t>(incidence.offset[a + 1] - incidence.offset[a]);
        layout.node_elements.push_back({shapes.corners.coordinates(first), valence});
    }
    for (const int entry : incidence.entry) {
        const auto element = static_cast<std::size_t>(entry / 4);
        const auto corner = static_cast<std::uint32_t>(entry % 4);
        layout.force_coordinates.push_back(shapes.elements.coordinates(element) | corner << 30U);
    }
    return layout;
}

}  // namespace tissuewarp::tled::detail
