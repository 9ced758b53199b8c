#include "registration/matching/ultrasound/speckle.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace tissuewarp::registration::detail {

namespace {

constexpr int apart = 3;  // strides between places

struct Patch {
    double mean, deviation;
};

/// Voxels from one of a patch to the next along each axis.
Voxel stride_of(const imaging::Geometry& grid, double mm) {
    Voxel stride{};
    for (std::size_t a = 0; a < 3; ++a)
        stride[a] = std::max(1, static_cast<int>(std::lround(mm / grid.spacing[static_cast<Eigen::Index>(a)])));
    return stride;
}

/// Of 27 voxels, all seen: about a plane through them.
std::optional<Patch> patch_of(const SeenImage& image, const Voxel& stride, int i, int j, int k) {
    double sum = 0, squares = 0;
    Eigen::Vector3d slope = Eigen::Vector3d::Zero();
    for (int c = -1; c <= 1; ++c)
        for (int b = -1; b <= 1; ++b)
            for (int a = -1; a <= 1; ++a) {
                const std::int64_t n = image.image.offset(i + a * stride[0], j + b * stride[1], k + c * stride[2]);
                if (!image.seen.data<std::uint8_t>()[n]) return std::nullopt;
                const double value = image.image.data<float>()[n];
                sum += value;
                squares += value * value;
                slope += value * Eigen::Vector3d(a, b, c);
            }
    constexpr double count = 27, moments = 18;
    const double left = squares - sum * sum / count - slope.squaredNorm() / moments;
    return Patch{sum / count, std::sqrt(std::max(0.0, left) / (count - 4))};
}

std::vector<Patch> patches_of_slice(const SeenImage& image, const Voxel& stride, int k) {
    const auto& size = image.image.geometry.size;
    std::vector<Patch> patches;
    for (int j = stride[1]; j < size[1] - stride[1]; j += apart * stride[1])
        for (int i = stride[0]; i < size[0] - stride[0]; i += apart * stride[0])
            if (const auto patch = patch_of(image, stride, i, j, k)) patches.push_back(*patch);
    return patches;
}

double percentile(std::vector<double>& values, double share) {
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * double(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

}  // namespace

double speckle_of(const SeenImage& image, const SpeckleOptions& options) {
    const Voxel stride = stride_of(image.image.geometry, options.step_mm);
    const int step = apart * stride[2], inner = std::max(0, image.image.geometry.size[2] - 2 * stride[2]);
    std::vector<std::vector<Patch>> slices(static_cast<std::size_t>((inner + step - 1) / step));
    tbb::parallel_for(std::size_t{0}, slices.size(), [&](std::size_t n) {
        slices[n] = patches_of_slice(image, stride, stride[2] + static_cast<int>(n) * step);
    });
    std::vector<Patch> patches;
    for (const auto& slice : slices) patches.insert(patches.end(), slice.begin(), slice.end());
    if (patches.empty()) return 0;
    std::vector<double> values;
    for (const Patch& patch : patches) values.push_back(patch.mean);
    const double dark = percentile(values, 0.01);
    values.clear();
    for (const Patch& patch : patches)
        if (patch.mean > dark) values.push_back(patch.deviation / (patch.mean - dark));
    return values.empty() ? 0 : percentile(values, 0.5);
}

bool is_speckled(const SeenImage& image, const SpeckleOptions& options) {
    const auto seen = cv::countNonZero(image.seen.voxels.reshape(1, 1));
    if (double(seen) > options.most_seen * double(image.seen.geometry.voxel_count())) return false;
    return speckle_of(image, options) >= options.least_speckle;
}

bool has_more_speckle(const SeenImage& fixed, const SeenImage& moving, const SpeckleOptions& options) {
    return speckle_of(fixed, options) >= options.least_over_moving * speckle_of(moving, options);
}

}  // namespace tissuewarp::registration::detail
