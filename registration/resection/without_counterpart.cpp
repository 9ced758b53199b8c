#include "registration/resection/without_counterpart.hpp"

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

namespace tissuewarp::registration::detail {

using imaging::Volume;

namespace {

/// What grey the fixed image mostly has where the moving one has a grey: median and deviation, by bins.
class ExpectedGrey {
public:
    ExpectedGrey(const Volume& moving, const Volume& fixed, const Volume& organ) {
        std::vector<float> sorted = values_in(moving, organ);
        tbb::parallel_sort(sorted.begin(), sorted.end());
        for (std::size_t b = 1; b < bins && !sorted.empty(); ++b) limits_.push_back(sorted[b * sorted.size() / bins]);
        std::array<std::vector<float>, bins> values;
        for (std::int64_t n = 0; n < fixed.geometry.voxel_count(); ++n)
            if (organ.data<std::uint8_t>()[n])
                values[bin_of(moving.data<float>()[n])].push_back(fixed.data<float>()[n]);
        tbb::parallel_for(std::size_t{0}, bins, [&](std::size_t b) { of_bin_[b] = spread_of(values[b]); });
    }
    /// In deviations.
    [[nodiscard]] double distance(float moving, float fixed) const {
        const Spread& expected = of_bin_[bin_of(moving)];
        return expected.deviation > 0 ? std::abs(fixed - expected.middle) / expected.deviation : 0;
    }

private:
    static constexpr std::size_t bins = 16;
    std::vector<float> limits_;
    std::array<Spread, bins> of_bin_{};
    [[nodiscard]] std::size_t bin_of(float value) const {
        return static_cast<std::size_t>(std::upper_bound(limits_.begin(), limits_.end(), value) - limits_.begin());
    }
};

}  // namespace

Volume without_counterpart(const CavityView& fixed, const CavityView& moving) {
    constexpr CavityOptions options = cavity_options;
    const Volume& organ = fixed.organ;
    const double most = options.most_deviation * fixed.tissue_deviation,
                 least = options.least_counterpart * moving.tissue_deviation;
    const ExpectedGrey expected(moving.grey, fixed.grey, organ);
    Volume core(organ.geometry, CV_8UC1);
    for (std::int64_t n = 0; n < organ.geometry.voxel_count(); ++n) {
        const bool flat = organ.data<std::uint8_t>()[n] && fixed.deviation.data<float>()[n] < most;
        core.data<std::uint8_t>()[n] =
            flat &&
            (moving.deviation.data<float>()[n] > least ||
             expected.distance(moving.grey.data<float>()[n], fixed.grey.data<float>()[n]) > options.least_difference);
    }
    return core;
}

}  // namespace tissuewarp::registration::detail
