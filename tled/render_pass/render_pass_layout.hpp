#pragma once
/// The rest state in the lists that the render passes read (contracts in shaders/chunks/element.textures.glsl and
/// shaders/render_pass/node_step.frag).

#include "shaders/texture.hpp"
#include "tled/gpu/gpu_layout.hpp"

#include <array>
#include <cstdint>
#include <vector>

namespace tissuewarp::tled::detail {

using Uint2 = std::array<std::uint32_t, 2>;

/// The shapes of the textures that hold a value per element, per node and per corner of all elements.
struct RenderPassShapes {
    shaders::TextureShape elements, nodes, corners;
};

struct RenderPassLayout {
    std::vector<Uint4> element_nodes;              ///< M, coordinates of nodes
    std::array<std::vector<Float4>, 3> rest;       ///< M: gradients of N1 to N3, with volume, material, modulus
    std::vector<Float4> materials;                 ///< two for each material
    std::vector<Uint2> node_elements;              ///< N, coordinates of the first entry below, valence (NodeElCrds)
    std::vector<std::uint32_t> force_coordinates;  ///< 4 M, coordinates of elements, corner in bits 30 and 31 (FCrds)
};
RenderPassLayout render_pass_layout(const RestState& rest, const RenderPassShapes& shapes);

}  // namespace tissuewarp::tled::detail
