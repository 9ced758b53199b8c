#include "registration/matching/descriptors/self_similarity.hpp"

#include "registration/matching/descriptors/brick_descriptors.hpp"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>

namespace tissuewarp::registration::detail {

namespace {

/// Mean squared difference of a voxel's neighbours over every second row, where they are seen. Summed slice by slice:
/// the same for any number of threads.
double mean_squared_difference(const GridSamples& samples, const imaging::Geometry& grid, const SearchRegion& region) {
    const Octahedron pattern = octahedron_edges();
    struct Sum {
        double squares = 0, count = 0;
    };
    std::vector<Sum> sums(static_cast<std::size_t>(grid.size[2] + 1) / 2);
    tbb::parallel_for(std::size_t{0}, sums.size(), [&](std::size_t slice) {
        const int k = 2 * static_cast<int>(slice);
        for (int j = 0; j < grid.size[1]; j += 2) {
            const Range range = region.row(j, k, 0);
            for (const auto& step : pattern.steps) {
                const float *here = samples.value(0, j, k), *there = samples.value(step[0], j + step[1], k + step[2]);
                const std::uint8_t *seen_here = samples.seen(0, j, k),
                                   *seen_there = samples.seen(step[0], j + step[1], k + step[2]);
                for (int i = range.first; i < range.last; ++i) {
                    if (!seen_here[i] || !seen_there[i]) continue;
                    const double difference = double(there[i]) - double(here[i]);
                    sums[slice].squares += difference * difference;
                    sums[slice].count += 1;
                }
            }
        }
    });
    Sum all;
    for (const Sum& sum : sums) {
        all.squares += sum.squares;
        all.count += sum.count;
    }
    return all.count > 0 ? all.squares / all.count : 0.0;
}

}  // namespace

Descriptors self_similarity_context(const GridSamples& samples, const imaging::Geometry& grid,
                                    const SearchRegion& region) {
    const double mean = std::max(mean_squared_difference(samples, grid, region), 1e-30);
    const VarianceBounds bounds{static_cast<float>(SelfSimilarityOptions().least_variance * mean),
                                static_cast<float>(SelfSimilarityOptions().most_variance * mean)};
    const auto voxels = static_cast<std::size_t>(grid.voxel_count());
    Descriptors result{std::make_unique_for_overwrite<std::uint8_t[]>(voxels * descriptor_channels),
                       std::vector<std::uint8_t>(voxels)};
    const Octahedron pattern = octahedron_edges();
    tbb::enumerable_thread_specific<BrickMemory> memories;
    const auto bricks = region.bricks();
    tbb::parallel_for(std::size_t{0}, bricks.size(), [&](std::size_t n) {
        describe_brick(samples, bricks[n], bounds, grid, pattern, memories.local(), result);
    });
    return result;
}

}  // namespace tissuewarp::registration::detail
