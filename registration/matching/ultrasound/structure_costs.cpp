#include "registration/matching/ultrasound/structure_costs.hpp"

#include "registration/matching/ultrasound/window_sums.hpp"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <limits>

namespace tissuewarp::registration::detail {

namespace {

using imaging::Volume;

/// Σ w and Σ w d over a window: w what both show, d the mean difference of descriptors.
using Sums = Eigen::Array<float, 2, 1>;
enum Sum { W, D };
using Grid = SumGrid<Sums>;

struct Work {
    Grid one, other;
};

/// Everywhere: beyond what is shown values are 0, and the rim of the organ, which shows best, would not count
/// otherwise.
MatchingImage described(const imaging::Geometry& grid, const std::vector<float>& values) {
    Volume image(grid, CV_32FC1), all(grid, CV_8UC1);
    std::copy(values.begin(), values.end(), image.data<float>());
    all.voxels = 1;
    return matching_image(image, all, grid, SearchRegion(grid));
}

class Shifted {
public:
    Shifted(const EchoImages& images, const StructureCostOptions& options)
        : options_(options),
          size_(images.grid.size),
          images_(images),
          echoes_(described(images.grid, images.echo)),
          moving_(described(images.grid, images.grey)),
          weights_(gaussian_window(options.window_mm / images.grid.spacing[0])) {}

    /// Sums of the windows about all places, of the moving image shifted by voxels.
    Grid& sums(const Eigen::Vector3i& shift, Work& work) const {
        fill(shift, work.one);
        return window_sums(weights_, options_.stride, work.one, work.other);
    }
    /// Shares of the windows that the ultrasound shows.
    Grid& shares(Work& work) const {
        work.one.size = size_;
        work.one.sums.assign(images_.seen.size(), Sums::Zero());
        for (std::size_t n = 0; n < images_.seen.size(); ++n) work.one.sums[n][W] = images_.seen[n];
        return window_sums(weights_, options_.stride, work.one, work.other);
    }

private:
    const StructureCostOptions& options_;
    std::array<int, 3> size_;
    const EchoImages& images_;
    MatchingImage echoes_, moving_;
    std::vector<float> weights_;

    void fill(const Eigen::Vector3i& shift, Grid& grid) const {
        grid.size = size_;
        grid.sums.assign(images_.seen.size(), Sums::Zero());
        const std::ptrdiff_t away = shift[0] + size_[0] * (shift[1] + std::ptrdiff_t{size_[1]} * shift[2]);
        for (int k = std::max(0, shift[2]); k < std::min(size_[2], size_[2] + shift[2]); ++k)
            for (int j = std::max(0, shift[1]); j < std::min(size_[1], size_[1] + shift[1]); ++j)
                for (int i = std::max(0, shift[0]); i < std::min(size_[0], size_[0] + shift[0]); ++i) {
                    const std::ptrdiff_t there = i + size_[0] * (j + std::ptrdiff_t{size_[1]} * k);
                    const auto n = static_cast<std::size_t>(there), from = static_cast<std::size_t>(there - away);
                    if (images_.seen[n] == 0 || images_.shown[from] == 0) continue;
                    grid.sums[n] << 1, difference(n, from);
                }
    }
    [[nodiscard]] float difference(std::size_t n, std::size_t from) const {
        constexpr float most = 255.F * descriptor_channels;
        const std::uint8_t *a = echoes_.descriptors.get() + n * descriptor_channels,
                           *b = moving_.descriptors.get() + from * descriptor_channels;
        int sum = 0;
        for (int c = 0; c < descriptor_channels; ++c) sum += std::abs(int(a[c]) - int(b[c]));
        return static_cast<float>(sum) / most;
    }
};

}  // namespace

EchoCosts structure_costs(const EchoImages& images, const StructureCostOptions& options) {
    EchoCosts result;
    result.step_mm = options.step * images.grid.spacing[0];
    result.reach = options.reach;
    result.places = images.grid;
    result.places.spacing *= options.stride;
    for (int& size : result.places.size) size = (size + options.stride - 1) / options.stride;
    const Shifted shifted(images, options);
    Work work;
    const Grid& full = shifted.shares(work);
    for (std::size_t n = 0; n < full.sums.size(); ++n)
        if (full.sums[n][W] >= options.least_share) {
            result.at.push_back(n);
            result.window_share.push_back(full.sums[n][W]);
        }
    const std::size_t lattice = result.lattice();
    result.cost.resize(result.at.size() * lattice);
    tbb::enumerable_thread_specific<Work> works;
    tbb::parallel_for(std::size_t{0}, lattice, [&](std::size_t entry) {
        const Grid& sums = shifted.sums(options.step * result.shift(entry), works.local());
        for (std::size_t n = 0; n < result.at.size(); ++n) {
            const Sums& here = sums.sums[result.at[n]];
            const bool lost = here[W] < (1 - options.most_lost) * result.window_share[n];
            result.cost[n * lattice + entry] = lost ? std::numeric_limits<float>::infinity() : here[D] / here[W];
        }
    });
    return result;
}

}  // namespace tissuewarp::registration::detail
