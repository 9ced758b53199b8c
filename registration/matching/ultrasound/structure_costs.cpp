#include "registration/matching/ultrasound/structure_costs.hpp"

#include "registration/matching/descriptors/matching_image.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <tuple>
#include <vector>

namespace tissuewarp::registration::detail {

namespace {

using imaging::Volume;

/// Σ w and Σ w d over a window: w what both show, d the mean difference of descriptors.
using Sums = Eigen::Array<float, 2, 1>;
enum Sum { W, D };
/// Everywhere: beyond what is shown values are 0, and the rim of the organ, which shows best, would not count
/// otherwise.
MatchingImage described(const imaging::Geometry& grid, const std::vector<float>& values) {
    Volume image(grid, CV_32FC1), all(grid, CV_8UC1);
    std::copy(values.begin(), values.end(), image.data<float>());
    all.voxels = 1;
    return matching_image(image, all, grid, SearchRegion(grid));
}

static_assert(descriptor_channels <= std::tuple_size_v<StructureDescriptor>);

/// Mean over the channels, 0..1.
float difference(const StructureDescriptor& one, const StructureDescriptor& other) {
    constexpr float most = 255.F * descriptor_channels;
    int sum = 0;
    for (std::size_t c = 0; c < one.size(); ++c) sum += std::abs(int(one[c]) - int(other[c]));
    return static_cast<float>(sum) / most;
}

std::vector<StructureDescriptor> descriptors_at(const std::vector<std::size_t>& voxels, const MatchingImage& image) {
    std::vector<StructureDescriptor> result(voxels.size(), StructureDescriptor{});
    for (std::size_t n = 0; n < voxels.size(); ++n)
        std::copy_n(image.descriptors.get() + voxels[n] * descriptor_channels, descriptor_channels, result[n].begin());
    return result;
}

/// Every `step`-th voxel of a grid along each axis, as offsets; the coarser grid.
std::vector<std::size_t> every(int step, imaging::Geometry& grid) {
    const std::array<int, 3> size = grid.size;
    std::vector<std::size_t> offsets;
    for (int k = 0; k < size[2]; k += step)
        for (int j = 0; j < size[1]; j += step)
            for (int i = 0; i < size[0]; i += step)
                offsets.push_back(static_cast<std::size_t>(i + size[0] * (j + std::ptrdiff_t{size[1]} * k)));
    for (int& along : grid.size) along = (along + step - 1) / step;
    grid.spacing *= step;
    return offsets;
}

}  // namespace

Structure structure_of(const EchoImages& images, int step) {
    Structure result{{images.grid, {}, {}, {}, {}, {}}, {}, {}};
    const std::vector<std::size_t> fine = every(step, result.images.grid);
    for (const std::size_t n : fine) {
        result.images.seen.push_back(images.seen[n]);
        result.images.shown.push_back(images.shown[n]);
    }
    result.echo = descriptors_at(fine, described(images.grid, images.echo));
    result.moving = descriptors_at(fine, described(images.grid, images.grey));
    return result;
}

ShiftedWindows windows_of(const StructureCostOptions& options) {
    return {options.window_mm, options.reach, options.stride, options.least_share, options.most_lost};
}

EchoCosts structure_costs(const EchoImages& images, const StructureCostOptions& options) {
    const Structure structure = structure_of(images, options.step);
    const auto add = [&](std::size_t n, std::size_t from, Sums& sums) {
        if (structure.images.shown[from] != 0) sums += Sums(1, difference(structure.echo[n], structure.moving[from]));
    };
    const auto cost = [](const Sums& sums) { return sums[D] / sums[W]; };
    return costs_of_shifts<Sums>(structure.images, windows_of(options), add, cost);
}

}  // namespace tissuewarp::registration::detail
