#pragma once
/// Products of the differences of two images' descriptors, summed over voxels.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace tissuewarp::registration::detail {

constexpr std::size_t most_product_voxels = 256;  ///< of a call: 32 bits hold their sums

/// Sums over voxels and channels, with g = D(x + e) − D(x − e), twice the central difference along an axis, and
/// r = D₁ − D₂. Integers, and therefore exact in any order.
struct DescriptorProducts {
    std::array<std::int32_t, 3> diagonal{};  ///< Σ g₁a g₂a
    std::array<std::int32_t, 3> mixed{};     ///< Σ g₁a g₂b + g₁b g₂a, ab = 01, 02, 12
    std::array<std::int32_t, 3> right{};     ///< Σ (g₁a + g₂a) r
    std::int32_t structure = 0;              ///< Σ |g₁|² + |g₂|²
    std::int32_t squares = 0;                ///< Σ r²
    std::array<std::int32_t, 3> slopes{};    ///< Σ (g₁a + g₂a) D₁
    std::array<std::int32_t, 3> ends{};      ///< Σ g₁a + g₂a
    std::int32_t first_squares = 0;          ///< Σ D₁²
    std::int32_t first = 0;                  ///< Σ D₁
    std::int32_t first_residual = 0;         ///< Σ D₁ r
    std::int32_t residual = 0;               ///< Σ r
};

/// Of `voxels` (offsets in voxels, most_product_voxels at most), whose neighbours lie ± `stride` away. Descriptors have
/// 12 bytes each; 4 more are read after those of each voxel and neighbour.
DescriptorProducts descriptor_products(const std::uint8_t* first, const std::uint8_t* second,
                                       const std::array<std::ptrdiff_t, 3>& stride,
                                       std::span<const std::ptrdiff_t> voxels);

}  // namespace tissuewarp::registration::detail
