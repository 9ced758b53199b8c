#pragma once
/// Vectors of four words, as storage blocks hold them.

#include <Eigen/Core>

#include <array>
#include <cstdint>

namespace tissuewarp::registration::detail {

using Float4 = std::array<float, 4>;
using Uint4 = std::array<std::uint32_t, 4>;

inline Float4 packed(const Eigen::Vector3d& v, double w = 0.0) {
    return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2]), static_cast<float>(w)};
}

/// Voxels along i, j, k.
inline Uint4 packed(const std::array<int, 3>& size) {
    return {static_cast<std::uint32_t>(size[0]), static_cast<std::uint32_t>(size[1]),
            static_cast<std::uint32_t>(size[2]), 0};
}

}  // namespace tissuewarp::registration::detail
