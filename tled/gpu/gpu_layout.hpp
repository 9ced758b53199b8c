#pragma once
/// The rest state in the arrays that the GLSL kernels read (contracts in shaders/chunks/element*.glsl, node.glsl and
/// shaders/kernels/nodal_pressure.comp).

#include "tled/conditions.hpp"
#include "tled/rest_state.hpp"

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace tissuewarp::tled::detail {

using Float2 = std::array<float, 2>;
using Float4 = std::array<float, 4>;
using Uint4 = std::array<std::uint32_t, 4>;

inline float single(double value) {
    return static_cast<float>(value);
}

struct GpuElements {
    std::vector<Uint4> nodes;                   ///< M
    std::vector<Float4> rest;                   ///< 3 M
    std::vector<Float4> materials;              ///< two for each material
    std::vector<Float4> fibre;                  ///< M; or empty
    std::vector<std::uint32_t> node_incidence;  ///< N + 1 offsets, 4 M positions of corner forces
};
GpuElements gpu_elements(const RestState& rest);

struct GpuPressure {
    std::vector<Uint4> corners;            ///< M
    std::vector<Float2> rest;              ///< 1/V_a, M_a
    std::vector<std::uint32_t> incidence;  ///< count + 1 offsets, 4 M elements
    std::vector<MaterialBlock> blocks;     ///< ranges of pressure nodes
};
GpuPressure gpu_pressure(const RestState& rest);

/// 3 × N in float64 to N float32 vectors of four, and back.
std::vector<Float4> packed(const Eigen::Matrix3Xd& vectors);
Eigen::Matrix3Xd unpacked(std::span<const Float4> vectors);

}  // namespace tissuewarp::tled::detail
