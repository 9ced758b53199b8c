// Plain loops, compiled for every instruction set and chosen at run time.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "registration/matching/descriptors/brick_descriptors.cpp"
// foreach_target.h must come before highway.h.
// clang-format off
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// clang-format on

#include "registration/matching/descriptors/brick_descriptors.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

HWY_BEFORE_NAMESPACE();
namespace tissuewarp::registration::detail {
namespace HWY_NAMESPACE {

using Brick = SearchRegion::Brick;
using Box = BrickMemory::Box;

constexpr int patch_radius = 4;  // voxels, where a Gaussian of one voxel has ended

/// Half of a Gaussian window of one voxel, from its centre on; the whole sums to 1.
std::array<float, patch_radius + 1> patch_window() {
    std::array<double, patch_radius + 1> weights;
    double sum = 0;
    for (int t = 0; t <= patch_radius; ++t) {
        weights[static_cast<std::size_t>(t)] = std::exp(-0.5 * t * t);
        sum += (t == 0 ? 1 : 2) * weights[static_cast<std::size_t>(t)];
    }
    std::array<float, patch_radius + 1> result;
    for (std::size_t t = 0; t < result.size(); ++t) result[t] = static_cast<float>(weights[t] / sum);
    return result;
}

/// Smooths `count` values along a line of neighbours `stride` apart.
void smooth_along(const float* from, std::ptrdiff_t stride, int count, float* __restrict to) {
    static const auto w = patch_window();
    const float w0 = w[0], w1 = w[1], w2 = w[2], w3 = w[3], w4 = w[4];
    for (int x = 0; x < count; ++x) {
        const float* c = from + x;
        to[x] = w0 * c[0] + w1 * (c[-stride] + c[stride]) + w2 * (c[-2 * stride] + c[2 * stride]) +
                w3 * (c[-3 * stride] + c[3 * stride]) + w4 * (c[-4 * stride] + c[4 * stride]);
    }
}

/// exp(−x), x ≥ 0, to 4e-5: eight bits need no more. Without calls or branches, so that compilers use vectors.
HWY_INLINE float decay(float x) {
    const float t = std::min(x * 1.442695F, 30.0F);  // log₂
    const int whole = static_cast<int>(t);
    const float y = (t - static_cast<float>(whole) - 0.5F) * 0.6931472F;
    const float fraction = 0.7071068F * (1 - y * (1 - y * (0.5F - y * (1.0F / 6 - y * (1.0F / 24)))));
    return fraction * std::bit_cast<float>((127 - whole) << 23);
}

/// The descriptors of a brick.
class BrickDescriber {
public:
    BrickDescriber(const Octahedron& pattern, BrickMemory& memory)
        : pattern_(pattern),
          along_i_(memory.along_i),
          along_j_(memory.along_j),
          distances_(memory.distances),
          line_(memory.line),
          scale_(memory.scale),
          smallest_(memory.smallest),
          bytes_(memory.bytes),
          seen_i_(memory.seen_i),
          seen_j_(memory.seen_j) {}

    void describe(const GridSamples& samples, const Brick& brick, const VarianceBounds& bounds,
                  const imaging::Geometry& grid, Descriptors& result) {
        for (std::size_t pair = 0; pair < 6; ++pair) patch_distances(samples, brick, pair);
        mark_seen(samples, brick, grid, result.seen.data());
        for (int k = brick.k.first; k < brick.k.last; ++k)
            for (int j = brick.j.first; j < brick.j.last; ++j) {
                const std::ptrdiff_t n = brick.i.first + grid.size[0] * (j + std::ptrdiff_t{grid.size[1]} * k);
                describe_row(brick, j - brick.j.first, k - brick.k.first, bounds,
                             result.channels.get() + n * descriptor_channels);
            }
    }

private:
    const Octahedron& pattern_;
    Box &along_i_, &along_j_;
    std::array<Box, 6>& distances_;
    std::vector<float>&line_, &scale_, &smallest_;
    std::vector<std::uint32_t>& bytes_;
    std::vector<std::uint8_t>&seen_i_, &seen_j_;

    /// Squared differences of a pair, smoothed along i, j and k in turn.
    void patch_distances(const GridSamples& samples, const Brick& brick, std::size_t pair) {
        constexpr int wide = octahedron_radius + patch_radius;
        const auto& step = pattern_.steps[pair];
        const std::ptrdiff_t away = samples.offset(step[0], step[1], step[2]) - samples.offset(0, 0, 0);
        const int width = brick.i.size() + 2 * octahedron_radius, rows = brick.j.size(), slices = brick.k.size();
        along_i_.shape(width, rows + 2 * wide, slices + 2 * wide);
        along_j_.shape(width, rows + 2 * octahedron_radius, slices + 2 * wide);
        Box& distances = distances_[pair];
        distances.shape(width, rows + 2 * octahedron_radius, slices + 2 * octahedron_radius);
        line_.resize(static_cast<std::size_t>(width + 2 * patch_radius));
        for (int k = 0; k < slices + 2 * wide; ++k) {
            for (int j = 0; j < rows + 2 * wide; ++j) {
                const float* value =
                    samples.value(brick.i.first - wide, brick.j.first + j - wide, brick.k.first + k - wide);
                for (std::ptrdiff_t x = 0; x < std::ssize(line_); ++x) {
                    const float difference = value[x + away] - value[x];
                    line_[static_cast<std::size_t>(x)] = difference * difference;
                }
                smooth_along(line_.data() + patch_radius, 1, width, along_i_.row(j, k));
            }
            for (int j = 0; j < rows + 2 * octahedron_radius; ++j)
                smooth_along(along_i_.row(j + patch_radius, k), along_i_.width, width, along_j_.row(j, k));
        }
        for (int k = 0; k < slices + 2 * octahedron_radius; ++k)
            for (int j = 0; j < rows + 2 * octahedron_radius; ++j)
                smooth_along(along_j_.row(j, k + patch_radius), along_j_.slice(), width, distances.row(j, k));
    }

    void describe_row(const Brick& brick, int j, int k, const VarianceBounds& bounds, std::uint8_t* __restrict result) {
        const auto width = static_cast<std::size_t>(brick.i.size());
        scale_.assign(width, 0.0F);
        smallest_.assign(width, std::numeric_limits<float>::max());
        bytes_.resize(width);
        float* __restrict scale = scale_.data();
        float* __restrict smallest = smallest_.data();
        const auto distances = [&](std::size_t c) {
            const auto& [pair, shift] = pattern_.channels[c];
            return distances_[pair].row(j + octahedron_radius + shift[1], k + octahedron_radius + shift[2]) +
                   octahedron_radius + shift[0];
        };
        for (std::size_t c = 0; c < descriptor_channels; ++c) {
            const float* d = distances(c);
            for (std::size_t x = 0; x < width; ++x) {
                scale[x] += d[x];
                smallest[x] = std::min(smallest[x], d[x]);
            }
        }
        for (std::size_t x = 0; x < width; ++x)
            scale[x] = 1 / std::min(std::max(scale[x] / descriptor_channels, bounds.least), bounds.most);
        for (std::size_t c = 0; c < descriptor_channels; c += 4) {  // four bytes at a time
            std::fill(bytes_.begin(), bytes_.end(), 0U);
            for (std::size_t part = 0; part < 4; ++part)
                add_levels(distances(c + part), smallest, scale, static_cast<int>(8 * part));
            for (std::size_t x = 0; x < width; ++x) std::memcpy(result + x * descriptor_channels + c, &bytes_[x], 4);
        }
    }

    /// Eight bits of exp((smallest − d) scale), moved up by `place` bits.
    void add_levels(const float* __restrict d, const float* __restrict smallest, const float* __restrict scale,
                    int place) {
        std::uint32_t* __restrict bytes = bytes_.data();
        const auto unit = static_cast<std::uint32_t>(1) << place;
        const std::size_t width = bytes_.size();
        for (std::size_t x = 0; x < width; ++x) {
            const int level = static_cast<int>(255 * decay((d[x] - smallest[x]) * scale[x]) + 0.5F);
            bytes[x] += static_cast<std::uint32_t>(level) * unit;
        }
    }

    /// Voxels whose cube of ± descriptor_reach is seen.
    void mark_seen(const GridSamples& samples, const Brick& brick, const imaging::Geometry& grid,
                   std::uint8_t* result) {
        constexpr int reach = descriptor_reach, side = 2 * reach + 1;
        const int width = brick.i.size(), rows = brick.j.size(), slices = brick.k.size();
        seen_i_.resize(static_cast<std::size_t>(width) * (rows + 2 * reach) * (slices + 2 * reach));
        seen_j_.resize(static_cast<std::size_t>(width) * rows * (slices + 2 * reach));
        const auto least_of = [&](const std::uint8_t* from, std::ptrdiff_t stride, std::uint8_t* __restrict to) {
            for (int x = 0; x < width; ++x) to[x] = from[x] != 0;
            for (int t = 1; t < side; ++t)
                for (int x = 0; x < width; ++x) to[x] &= from[x + t * stride] != 0;
        };
        for (int k = 0; k < slices + 2 * reach; ++k) {
            std::uint8_t* slice = seen_i_.data() + std::ptrdiff_t{width} * (rows + 2 * reach) * k;
            for (int j = 0; j < rows + 2 * reach; ++j)
                least_of(samples.seen(brick.i.first - reach, brick.j.first + j - reach, brick.k.first + k - reach), 1,
                         slice + std::ptrdiff_t{width} * j);
            for (int j = 0; j < rows; ++j)
                least_of(slice + std::ptrdiff_t{width} * j, width,
                         seen_j_.data() + std::ptrdiff_t{width} * (j + std::ptrdiff_t{rows} * k));
        }
        for (int k = 0; k < slices; ++k)
            for (int j = 0; j < rows; ++j)
                least_of(seen_j_.data() + std::ptrdiff_t{width} * (j + std::ptrdiff_t{rows} * k),
                         std::ptrdiff_t{width} * rows,
                         result + brick.i.first +
                             grid.size[0] * (brick.j.first + j + std::ptrdiff_t{grid.size[1]} * (brick.k.first + k)));
    }
};

void describe(const GridSamples& samples, const Brick& brick, const VarianceBounds& bounds,
              const imaging::Geometry& grid, const Octahedron& pattern, BrickMemory& memory, Descriptors& result) {
    BrickDescriber(pattern, memory).describe(samples, brick, bounds, grid, result);
}

}  // namespace HWY_NAMESPACE
}  // namespace tissuewarp::registration::detail
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tissuewarp::registration::detail {

HWY_EXPORT(describe);

void describe_brick(const GridSamples& samples, const SearchRegion::Brick& brick, const VarianceBounds& bounds,
                    const imaging::Geometry& grid, const Octahedron& pattern, BrickMemory& memory,
                    Descriptors& result) {
    HWY_DYNAMIC_DISPATCH(describe)(samples, brick, bounds, grid, pattern, memory, result);
}

Octahedron octahedron_edges() {
    Octahedron pattern{};
    std::size_t pair = 0, channel = 0;
    for (std::size_t p = 0; p < 3; ++p)
        for (std::size_t q = p + 1; q < 3; ++q)
            for (const int sign : {-1, 1}) {
                std::array<int, 3> step{}, at_q{}, at_p{};
                step[p] = octahedron_radius;
                step[q] = sign * octahedron_radius;
                at_q[q] = -sign * octahedron_radius;  // + step: the neighbour at +p
                at_p[p] = -octahedron_radius;         // + step: the neighbour at sign · q
                pattern.steps[pair] = step;
                pattern.channels[channel++] = {pair, at_q};
                pattern.channels[channel++] = {pair, at_p};
                ++pair;
            }
    return pattern;
}

}  // namespace tissuewarp::registration::detail
#endif
