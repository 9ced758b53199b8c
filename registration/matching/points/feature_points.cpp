#include "imaging/filters.hpp"
#include "imaging/sampling.hpp"
#include "registration/matching/descriptors/matching_grid.hpp"
#include "registration/matching/descriptors/matching_image.hpp"
#include "registration/matching/image_matching.hpp"

#include <Eigen/Eigenvalues>

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace tissuewarp::registration {

using imaging::Volume;

namespace {

constexpr FeaturePointRules rules;

/// The six products of a symmetric tensor, smoothed.
using TensorField = std::array<Volume, 6>;
constexpr std::array<std::pair<int, int>, 6> entries{{{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}}};

TensorField structure_tensors(const Volume& image, const FeatureOptions& options) {
    const Volume gradient = imaging::gradient(imaging::smooth(image, options.gradient_mm));
    const auto* g = gradient.data<cv::Vec3f>();
    TensorField field;
    for (std::size_t e = 0; e < entries.size(); ++e) {
        Volume product(image.geometry, CV_32FC1);
        const auto [a, b] = entries[e];
        tbb::parallel_for(std::int64_t{0}, static_cast<std::int64_t>(image.geometry.voxel_count()),
                          [&, a = a, b = b](std::int64_t n) { product.data<float>()[n] = g[n][a] * g[n][b]; });
        field[e] = imaging::smooth(product, options.window_mm);
    }
    return field;
}

Eigen::Matrix3d tensor_at(const TensorField& field, std::int64_t n) {
    Eigen::Matrix3d tensor;
    for (std::size_t e = 0; e < entries.size(); ++e) {
        const auto [a, b] = entries[e];
        tensor(a, b) = tensor(b, a) = double(field[e].data<float>()[n]);
    }
    return tensor;
}

/// Offsets of the voxels in or near the mask, away from padding, whose rim would pass for structure.
std::vector<std::int64_t> candidates(const Volume& image, const Volume& mask, const FeatureOptions& options) {
    const Volume near = imaging::dilate(mask, options.margin_mm);
    const Volume seen = imaging::erode(detail::seen_region(image), options.gradient_mm + options.window_mm);
    std::vector<std::int64_t> result;
    for (std::int64_t n = 0; n < mask.geometry.voxel_count(); ++n)
        if (near.data<std::uint8_t>()[n] && seen.data<std::uint8_t>()[n]) result.push_back(n);
    if (result.empty()) throw InvalidInput("the image is constant in the mask: there is nothing to match");
    return result;
}

double median_mean_eigenvalue(const TensorField& field, const std::vector<std::int64_t>& voxels) {
    std::vector<double> means;
    means.reserve(voxels.size());
    for (const std::int64_t n : voxels) means.push_back(tensor_at(field, n).trace() / 3);
    const auto middle = means.begin() + static_cast<std::ptrdiff_t>(means.size() / 2);
    std::nth_element(means.begin(), middle, means.end());
    return *middle > 0 ? *middle : *std::max_element(means.begin(), means.end());
}

/// (score, voxel) by falling score.
std::vector<std::pair<double, std::int64_t>> ranked(const TensorField& field, const std::vector<std::int64_t>& voxels) {
    const double half = median_mean_eigenvalue(field, voxels);
    if (!(half > 0)) throw InvalidInput("the image is constant in the mask: there is nothing to match");
    std::vector<std::pair<double, std::int64_t>> scored(voxels.size());
    tbb::parallel_for(std::size_t{0}, voxels.size(), [&](std::size_t n) {
        const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(tensor_at(field, voxels[n]), Eigen::EigenvaluesOnly);
        const Eigen::Array3d strength = axes.eigenvalues().array().max(0.0);
        scored[n] = {(strength / (strength + half)).sum(), voxels[n]};
    });
    std::erase_if(scored, [](const auto& entry) { return entry.first < rules.least_score; });
    std::sort(scored.begin(), scored.end(), [](const auto& a, const auto& b) {
        return a.first != b.first ? a.first > b.first : a.second < b.second;
    });
    return scored;
}

/// Accepts points that keep their distance from all accepted before: cells of that size hold one point at most each,
/// and a rival lies in one of the 27 about a point.
class SpreadPoints {
public:
    explicit SpreadPoints(double distance) : distance_(distance) {}

    bool add(const Eigen::Vector3d& point) {
        const Eigen::Array3i cell = (point / distance_).array().floor().cast<int>();
        for (int n = 0; n < 27; ++n) {
            const auto other = cells_.find({cell[0] + n % 3 - 1, cell[1] + n / 3 % 3 - 1, cell[2] + n / 9 - 1});
            if (other == cells_.end()) continue;
            for (const Eigen::Vector3d& taken : other->second)
                if ((taken - point).norm() < distance_) return false;
        }
        cells_[{cell[0], cell[1], cell[2]}].push_back(point);
        return true;
    }

private:
    double distance_;
    std::map<std::array<int, 3>, std::vector<Eigen::Vector3d>> cells_;
};

Eigen::Vector3d point_of(const imaging::Geometry& grid, std::int64_t n) {
    const std::int64_t nx = grid.size[0], ny = grid.size[1];
    return grid.point({double(n % nx), double(n / nx % ny), double(n / (nx * ny))});
}

}  // namespace

FeaturePoints select_feature_points(const Volume& image, const Volume& mask, const FeatureOptions& options) {
    detail::require_finite(image, "feature points: the image");
    if (options.count < 1)
        throw InvalidInput("feature points: a count of " + std::to_string(options.count) + "; 1 or more");
    const double border = options.margin_mm + 3 * (options.window_mm + options.gradient_mm);
    const imaging::Geometry grid = detail::grid_about_mask(image.geometry, mask, border, options.grid_spacing_mm);
    const Volume values = imaging::resample(image.as(CV_32F), grid, imaging::Interpolation::Linear);
    const Volume inside = imaging::resample(mask, grid, imaging::Interpolation::Nearest, 0);
    const TensorField field = structure_tensors(values, options);
    const std::vector<std::int64_t> near = candidates(values, inside, options);

    // Balls about points taken at random until none fits fill 0.38 of space (random sequential adsorption).
    const double volume = double(near.size()) * grid.voxel_volume();
    SpreadPoints spread(std::cbrt(6 / EIGEN_PI * rules.packing * volume / options.count));
    FeaturePoints result{Eigen::Matrix3Xd(3, options.count), {}};
    for (const auto& [score, n] : ranked(field, near)) {
        if (static_cast<int>(result.structure.size()) == options.count) break;
        const Eigen::Vector3d point = point_of(grid, n);
        if (!spread.add(point)) continue;
        result.points.col(static_cast<Eigen::Index>(result.structure.size())) = point;
        result.structure.push_back(tensor_at(field, n));
    }
    result.points.conservativeResize(3, static_cast<Eigen::Index>(result.structure.size()));
    return result;
}

}  // namespace tissuewarp::registration
