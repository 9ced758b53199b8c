#pragma once
/// MIND-SSC descriptors of a brick of voxels.

#include "registration/matching/descriptors/self_similarity.hpp"

namespace tissuewarp::registration::detail {

constexpr int octahedron_radius = 2;  ///< voxels from the centre to the six neighbours. By hand; data not recorded

/// Where a channel's patch distance is kept: in that of a pair, at a voxel `shift` away.
struct Channel {
    std::size_t pair;
    std::array<int, 3> shift;
};

struct Octahedron {
    std::array<std::array<int, 3>, 6> steps;  ///< between the two patches of a pair
    std::array<Channel, descriptor_channels> channels;
};

/// The edges of the octahedron of the six neighbours. Opposite edges share a step, so six maps hold all twelve.
Octahedron octahedron_edges();

/// Of the mean patch distance V.
struct VarianceBounds {
    float least, most;
};

/// Memory that is used again from brick to brick.
struct BrickMemory {
    /// Values over a box of rows.
    struct Box {
        int rows = 0;              ///< along j
        std::ptrdiff_t width = 0;  ///< along i
        std::vector<float> values;

        void shape(int along_i, int along_j, int along_k) {
            rows = along_j;
            width = along_i;
            values.resize(static_cast<std::size_t>(along_i) * along_j * along_k);
        }
        [[nodiscard]] std::ptrdiff_t slice() const { return width * rows; }
        [[nodiscard]] float* row(int j, int k) { return values.data() + j * width + k * slice(); }
    };

    Box along_i, along_j;
    std::array<Box, 6> distances;  ///< the brick and two voxels about it
    std::vector<float> line, scale, smallest;
    std::vector<std::uint32_t> bytes;
    std::vector<std::uint8_t> seen_i, seen_j;
};

/// Fills in the descriptors of a brick and where they count.
void describe_brick(const GridSamples& samples, const SearchRegion::Brick& brick, const VarianceBounds& bounds,
                    const imaging::Geometry& grid, const Octahedron& pattern, BrickMemory& memory, Descriptors& result);

}  // namespace tissuewarp::registration::detail
