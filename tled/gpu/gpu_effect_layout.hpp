#pragma once
/// Effects in the arrays that the GLSL chunks read (contracts in shaders/chunks/surface*.glsl and node.*.glsl). Words
/// hold whole numbers, or floats by their bits.

#include "tled/conditions.hpp"
#include "tled/gpu/gpu_layout.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <vector>

namespace tissuewarp::tled::detail {

std::vector<std::uint32_t> gpu_springs(const NodalConditions& conditions, int node_count);

struct GpuSurface {
    std::vector<std::uint32_t> words;
    std::uint32_t pressure_lists = 0, membrane_lists = 0, sliding_lists = 0,
                  parting_lists = 0;  ///< places in words; 0: no such effect
};
/// `position` is at rest, 3 × N, mm.
GpuSurface gpu_surface(const SurfaceEffects& effects, const Eigen::Matrix3Xd& position);

std::vector<Float4> gpu_fluid(const NodalFluid& fluid);

/// All of contact, and its beginning, which is what changes when bodies move.
std::vector<std::uint32_t> gpu_contact(const NodalContact& contact, int node_count);
std::vector<std::uint32_t> gpu_obstacles(const NodalContact& contact, int node_count);

}  // namespace tissuewarp::tled::detail
