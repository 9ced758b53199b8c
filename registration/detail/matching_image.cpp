#include "registration/detail/matching_image.hpp"

#include "imaging/filters.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

namespace tissuewarp::registration::detail {

using imaging::Volume;

namespace {

/// Largest and smallest of three along one axis, borders replicated; the neighbourhoods of three axes make the cube.
template <class Choose>
cv::Mat along_axis(const cv::Mat& from, std::int64_t stride, int size, const Choose& choose) {
    cv::Mat to(3, from.size.p, from.type());
    const float* source = from.ptr<float>();
    float* target = to.ptr<float>();
    const auto total = static_cast<std::int64_t>(from.total());
    tbb::parallel_for(std::int64_t{0}, total, [&](std::int64_t n) {
        const auto index = (n / stride) % size;
        const float before = source[index > 0 ? n - stride : n], after = source[index + 1 < size ? n + stride : n];
        target[n] = choose(choose(before, source[n]), after);
    });
    return to;
}

template <class Choose>
cv::Mat over_cube(const Volume& image, const Choose& choose) {
    const auto& size = image.geometry.size;
    cv::Mat result = along_axis(image.voxels, 1, size[0], choose);
    result = along_axis(result, size[0], size[1], choose);
    return along_axis(result, std::int64_t{size[0]} * size[1], size[2], choose);
}

constexpr auto lower = [](float a, float b) { return std::min(a, b); };
constexpr auto upper = [](float a, float b) { return std::max(a, b); };

/// Seen voxels whose cube of ± reach is seen and lies in the grid.
Volume eroded(const Volume& seen, int reach) {
    Volume result = seen.as(CV_32F);
    for (int pass = 0; pass < reach; ++pass) result.voxels = over_cube(result, lower);
    const auto& size = seen.geometry.size;
    for (int k = 0; k < size[2]; ++k)
        for (int j = 0; j < size[1]; ++j)
            for (int i = 0; i < size[0]; ++i)
                if (std::min({i, j, k, size[0] - 1 - i, size[1] - 1 - j, size[2] - 1 - k}) < reach)
                    result.data<float>()[result.offset(i, j, k)] = 0;
    return result.as(CV_8U);
}

std::vector<std::uint8_t> runs_along_rows(const Volume& seen) {
    const auto& size = seen.geometry.size;
    std::vector<std::uint8_t> runs(static_cast<std::size_t>(seen.geometry.voxel_count()));
    for (int k = 0; k < size[2]; ++k)
        for (int j = 0; j < size[1]; ++j) {
            int run = 0;
            for (int i = size[0] - 1; i >= 0; --i) {
                const auto n = static_cast<std::size_t>(seen.offset(i, j, k));
                run = seen.data<std::uint8_t>()[n] ? std::min(run + 1, 255) : 0;
                runs[n] = static_cast<std::uint8_t>(run);
            }
        }
    return runs;
}

std::vector<float> centred_values(const Volume& image, const Volume& seen) {
    const float* value = image.data<float>();
    std::vector<float> values(value, value + image.geometry.voxel_count());
    const auto mean = static_cast<float>(cv::mean(
        cv::Mat(1, static_cast<int>(values.size()), CV_32F, values.data()),
        cv::Mat(1, static_cast<int>(values.size()), CV_8U, const_cast<std::uint8_t*>(seen.data<std::uint8_t>())))[0]);
    for (float& v : values) v -= mean;
    return values;
}

}  // namespace

Volume seen_region(const Volume& image) {
    Volume varies(image.geometry, CV_32FC1);
    const cv::Mat least = over_cube(image, lower), most = over_cube(image, upper);
    const auto total = image.geometry.voxel_count();
    for (std::int64_t n = 0; n < total; ++n)
        varies.data<float>()[n] = most.ptr<float>()[n] > least.ptr<float>()[n] ? 1.0F : 0.0F;
    varies.voxels = over_cube(varies, lower);
    return varies.as(CV_8U);
}

MatchingImage matching_image(const Volume& image, const Volume& seen, const imaging::Geometry& grid,
                             Similarity similarity) {
    const Volume smoothed = imaging::smooth(image, 0.4 * grid.spacing[0]);
    const Volume values = imaging::resample(smoothed, grid, imaging::Interpolation::Linear);
    const Volume there = imaging::resample(seen, grid, imaging::Interpolation::Nearest, 0);
    MatchingImage result{grid, {}, {}, {}};
    if (similarity == Similarity::SelfSimilarityContext) {
        result.descriptors = self_similarity_context(values, there);
        result.seen_run = runs_along_rows(eroded(there, descriptor_reach));
    } else {
        result.values = centred_values(values, there);
        result.seen_run = runs_along_rows(there);
    }
    return result;
}

}  // namespace tissuewarp::registration::detail
