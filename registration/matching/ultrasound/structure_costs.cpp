#include "registration/matching/ultrasound/structure_costs.hpp"

#include "registration/matching/ultrasound/shifted_windows.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
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

/// As wide as what one instruction compares; beyond the channels 0.
using Descriptor = std::array<std::uint8_t, 16>;
static_assert(descriptor_channels <= 16);

/// Mean over the channels, 0..1.
float difference(const Descriptor& one, const Descriptor& other) {
    constexpr float most = 255.F * descriptor_channels;
    int sum = 0;
    for (std::size_t c = 0; c < one.size(); ++c) sum += std::abs(int(one[c]) - int(other[c]));
    return static_cast<float>(sum) / most;
}

std::vector<Descriptor> descriptors_at(const std::vector<std::size_t>& voxels, const MatchingImage& image) {
    std::vector<Descriptor> result(voxels.size(), Descriptor{});
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

EchoCosts structure_costs(const EchoImages& images, const StructureCostOptions& options) {
    const MatchingImage echoes = described(images.grid, images.echo), moving = described(images.grid, images.grey);
    EchoImages compared{images.grid, {}, {}, {}, {}, {}};
    const std::vector<std::size_t> fine = every(options.step, compared.grid);
    for (const std::size_t n : fine) {
        compared.echo.push_back(images.echo[n]);
        compared.seen.push_back(images.seen[n]);
        compared.shown.push_back(images.shown[n]);
    }
    const std::vector<Descriptor> seen = descriptors_at(fine, echoes), like = descriptors_at(fine, moving);
    const auto add = [&](std::size_t n, std::size_t from, Sums& sums) {
        if (compared.shown[from] != 0) sums += Sums(1, difference(seen[n], like[from]));
    };
    const auto cost = [](const Sums& sums) { return sums[D] / sums[W]; };
    const ShiftedWindows windows{options.window_mm, options.reach, options.stride, options.least_share,
                                 options.most_lost};
    return costs_of_shifts<Sums>(compared, windows, add, cost);
}

}  // namespace tissuewarp::registration::detail
