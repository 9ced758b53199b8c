#include "registration/matching/ultrasound/brick_windows.hpp"

#include <algorithm>
#include <cmath>

namespace tissuewarp::registration::detail {

namespace {

/// Of this sum, cut off after two deviations.
std::vector<float> gaussian_window(double deviation_bricks, float sum) {
    constexpr double cut = 2;  // deviations
    const int radius = std::max(1, static_cast<int>(std::lround(cut * deviation_bricks)));
    std::vector<float> weights;
    float total = 0;
    for (int n = -radius; n <= radius; ++n) {
        weights.push_back(static_cast<float>(std::exp(-0.5 * std::pow(n / deviation_bricks, 2))));
        total += weights.back();
    }
    for (float& weight : weights) weight *= sum / total;
    return weights;
}

std::vector<std::size_t> listed(const std::vector<bool>& bricks) {
    std::vector<std::size_t> list;
    for (std::size_t n = 0; n < bricks.size(); ++n)
        if (bricks[n]) list.push_back(n);
    return list;
}

std::vector<bool> both(std::vector<bool> one, const std::vector<bool>& other) {
    for (std::size_t n = 0; n < one.size(); ++n) one[n] = one[n] && other[n];
    return one;
}

}  // namespace

BrickWindows::BrickWindows(const EchoImages& images, int side, double deviation_mm, double least_share)
    : grid_(images.grid), voxels_(images.grid.size) {
    grid_.origin = images.grid.point(Eigen::Vector3d::Constant(0.5 * (side - 1)));
    grid_.spacing *= side;
    for (int& along : grid_.size) along = (along + side - 1) / side;
    steps_ = {1, grid_.size[0], std::ptrdiff_t{grid_.size[0]} * grid_.size[1]};
    weights_ = gaussian_window(deviation_mm / grid_.spacing[0], 1 / static_cast<float>(side));
    radius_ = static_cast<int>(weights_.size()) / 2;
    find_seen(images, side);
    find_places(least_share);
}

void BrickWindows::find_seen(const EchoImages& images, int side) {
    std::size_t n = 0;
    for (int k = 0; k < voxels_[2]; ++k)
        for (int j = 0; j < voxels_[1]; ++j)
            for (int i = 0; i < voxels_[0]; ++i, ++n)
                if (images.seen[n] != 0) {
                    const std::ptrdiff_t brick = i / side + steps_[1] * (j / side) + steps_[2] * (k / side);
                    seen_.push_back({n, static_cast<std::size_t>(brick), {i, j, k}});
                }
}

void BrickWindows::find_places(double least_share) {
    const auto count = static_cast<std::size_t>(grid_.voxel_count());
    std::vector<float> share(count, 0.F);
    for (const SeenVoxel& voxel : seen_) share[voxel.brick] += 1;
    std::vector<bool> filled(count);
    for (std::size_t n = 0; n < count; ++n) filled[n] = share[n] > 0;
    for (const int axis : {2, 1, 0}) {
        std::vector<float> smoothed(count, 0.F);
        for (std::size_t n = 0; n < count; ++n) {
            const auto [first, last] = window(axis, n);
            for (int d = first; d <= last; ++d)
                smoothed[n] +=
                    weight(d) * share[static_cast<std::size_t>(static_cast<std::ptrdiff_t>(n) + d * step(axis))];
        }
        share.swap(smoothed);
    }
    std::vector<bool> looked_at(count);
    for (std::size_t n = 0; n < count; ++n) looked_at[n] = share[n] >= least_share;
    const std::vector<bool> told_k = spread(filled, 2), told_kj = spread(told_k, 1);
    const std::vector<bool> needed_kj = both(spread(looked_at, 0), told_kj);
    filled_ = listed(filled);
    along_kj_ = listed(needed_kj);
    along_k_ = listed(both(spread(needed_kj, 1), told_k));
    places_ = listed(looked_at);
    for (const std::size_t n : places_) shares_.push_back(share[n]);
}

std::pair<int, int> BrickWindows::window(int axis, std::size_t brick) const {
    const auto a = static_cast<std::size_t>(axis);
    const int length = grid_.size[a], at = static_cast<int>(static_cast<std::ptrdiff_t>(brick) / steps_[a] % length);
    return {std::max(-radius_, -at), std::min(radius_, length - 1 - at)};
}

std::vector<bool> BrickWindows::spread(const std::vector<bool>& bricks, int axis) const {
    std::vector<bool> result(bricks.size());
    for (std::size_t n = 0; n < bricks.size(); ++n) {
        const auto [first, last] = window(axis, n);
        for (int d = first; d <= last && !result[n]; ++d)
            result[n] = bricks[static_cast<std::size_t>(static_cast<std::ptrdiff_t>(n) + d * step(axis))];
    }
    return result;
}

}  // namespace tissuewarp::registration::detail
