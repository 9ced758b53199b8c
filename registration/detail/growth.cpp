#include "registration/detail/growth.hpp"

namespace tissuewarp::registration::detail {

namespace {

constexpr std::uint8_t outside = 0, grown = 1, waits = 2;

/// Calls visit(neighbour, its bit) for those of a voxel that lie on the grid.
template <class Visit>
void for_each_neighbour(std::int64_t voxel, const std::array<int, 3>& size, const Visit& visit) {
    std::int64_t stride = 1;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::int64_t n = voxel / stride % size[axis];
        if (n > 0) visit(voxel - stride, 1U << (2 * axis));
        if (n + 1 < size[axis]) visit(voxel + stride, 2U << (2 * axis));
        stride *= size[axis];
    }
}

}  // namespace

std::vector<std::vector<GrownVoxel>> growth_layers(std::vector<std::uint8_t> inside, const std::array<int, 3>& size,
                                                   int count) {
    const auto state = [&](std::int64_t voxel) -> std::uint8_t& { return inside[static_cast<std::size_t>(voxel)]; };
    std::vector<std::vector<GrownVoxel>> layers(static_cast<std::size_t>(count));
    std::vector<std::int64_t> next;
    const auto find_next = [&](std::int64_t voxel) {
        for_each_neighbour(voxel, size, [&](std::int64_t other, std::uint32_t) {
            if (state(other) != outside) return;
            state(other) = waits;
            next.push_back(other);
        });
    };
    for (std::int64_t voxel = 0; voxel < static_cast<std::int64_t>(inside.size()); ++voxel)
        if (state(voxel) == grown) find_next(voxel);
    for (std::vector<GrownVoxel>& layer : layers) {
        std::vector<std::int64_t> front;
        front.swap(next);
        for (const std::int64_t voxel : front) {
            GrownVoxel entry{static_cast<std::uint32_t>(voxel), 0};
            for_each_neighbour(voxel, size, [&](std::int64_t other, std::uint32_t bit) {
                if (state(other) == grown) entry.neighbours |= bit;
            });
            layer.push_back(entry);
        }
        for (const std::int64_t voxel : front) state(voxel) = grown;
        for (const std::int64_t voxel : front) find_next(voxel);
    }
    return layers;
}

}  // namespace tissuewarp::registration::detail
