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

/// Mean over the channels of two voxels, 0..1.
float difference(const MatchingImage& one, std::size_t n, const MatchingImage& other, std::size_t m) {
    constexpr float most = 255.F * descriptor_channels;
    const std::uint8_t *a = one.descriptors.get() + n * descriptor_channels,
                       *b = other.descriptors.get() + m * descriptor_channels;
    int sum = 0;
    for (int c = 0; c < descriptor_channels; ++c) sum += std::abs(int(a[c]) - int(b[c]));
    return static_cast<float>(sum) / most;
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
    const auto pixel = [&](std::size_t n, std::size_t from) {
        return Sums(1, difference(echoes, fine[n], moving, fine[from]));
    };
    const auto cost = [](const Sums& sums) { return sums[D] / sums[W]; };
    const ShiftedWindows windows{options.window_mm, options.reach, options.stride, options.least_share,
                                 options.most_lost};
    return costs_of_shifts<Sums>(compared, windows, pixel, cost);
}

}  // namespace tissuewarp::registration::detail
