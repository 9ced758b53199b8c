#include "study/detail/phantom_image.hpp"

#include "imaging/filters.hpp"
#include "imaging/labels.hpp"
#include "study/detail/phantom_data.hpp"
#include "study/detail/texture.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace tissuewarp::study::detail {

using Eigen::Vector3d;

namespace {

constexpr double voxel_mm = 1.5;

/// Dark where it was bright and the other way round, not linearly; 0 stays 0.
imaging::Volume other_contrast(const imaging::Volume& image) {
    imaging::Volume result = image.clone();
    float* value = result.data<float>();
    for (std::int64_t n = 0; n < image.geometry.voxel_count(); ++n) {
        const double x = std::clamp(value[n] / 220.0, 0.0, 1.0);
        value[n] = static_cast<float>(220 * std::pow(1 - x, 1.5) * x * x / (x * x + 0.01));
    }
    return result;
}

/// Means of three slices each.
imaging::Volume thick_slices(const imaging::Volume& image) {
    constexpr int together = 3;
    imaging::Geometry grid = image.geometry;
    grid.size[2] /= together;
    grid.spacing[2] *= together;
    grid.origin = image.geometry.point({0, 0, 0.5 * (together - 1)});
    imaging::Volume result(grid, CV_32FC1);
    const std::int64_t slice = std::int64_t{grid.size[0]} * grid.size[1];
    for (std::int64_t n = 0; n < grid.voxel_count(); ++n) {
        double sum = 0;
        for (int s = 0; s < together; ++s) sum += image.data<float>()[n % slice + slice * (n / slice * together + s)];
        result.data<float>()[n] = static_cast<float>(sum / together);
    }
    return result;
}

/// Everything outside a ball becomes 0.
imaging::Volume within(const imaging::Volume& whole, const Ball& view) {
    imaging::Volume image = whole.clone();
    float* value = image.data<float>();
    const imaging::Geometry& grid = image.geometry;
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i, ++value)
                if (!view.holds(grid.point({double(i), double(j), double(k)}))) *value = 0;
    return image;
}

/// A ball about a point of the surface that holds a share of these points.
Ball view_of(const Eigen::Matrix3Xd& tissue, const Vector3d& middle, double share) {
    std::vector<double> distances;
    for (const auto& point : tissue.colwise()) distances.push_back((point - middle).norm());
    const auto rank = std::ptrdiff_t(share * double(distances.size()));
    std::nth_element(distances.begin(), distances.begin() + rank, distances.end());
    return {middle, distances[std::size_t(rank)]};
}

/// uint8: voxels that hold no tissue and are the hole of what was resected, or not connected to what is around it.
imaging::Volume hole_in(const TrueTissue& tissue, const imaging::Geometry& grid) {
    if (tissue.hollow)
        return filled(grid, [&](const Vector3d& x) { return !tissue.backward(x) && tissue.hollow(x) ? 1.0 : 0.0; })
            .as(CV_8U);
    const imaging::Volume without =
        filled(grid, [&](const Vector3d& x) { return tissue.backward(x) ? 0.0 : 1.0; }).as(CV_8U);
    const imaging::Volume pieces = imaging::connected_components(without);
    imaging::Volume enclosed(grid, CV_8UC1);
    enclosed.voxels = pieces.voxels > 1;  // the largest is what is around the organ
    return enclosed;
}

}  // namespace

PhantomImages drawn_images(const TrueTissue& tissue, Random& random) {
    constexpr double most_turn_deg = 15, noise = 3, degraded_noise = 8, least_share = 0.35, most_share = 0.7;
    const Texture organ(random), around(random);
    const SmoothValues bias(0.05, tissue.length, random);
    const Eigen::Matrix3Xd after = surface_samples(tissue, 60, random);
    Eigen::Matrix3Xd before(3, after.cols());
    for (Eigen::Index p = 0; p < after.cols(); ++p)
        before.col(p) = tissue.backward(after.col(p)).value_or(tissue.placement.inverse() * after.col(p));
    const Eigen::Matrix3d moving_axes = small_turn(most_turn_deg, random),
                          fixed_axes = small_turn(most_turn_deg, random);

    const imaging::Volume moving = filled(random_grid(before, moving_axes, voxel_mm, random), [&](const Vector3d& X) {
        const int label = tissue.label(X);
        return label > 0 ? organ(X, label) : around(X, 0);
    });
    const Eigen::Isometry3d back = tissue.placement.inverse();
    imaging::Volume fixed = filled(random_grid(after, fixed_axes, voxel_mm, random), [&](const Vector3d& x) {
        const auto X = tissue.backward(x);
        const int label = X ? tissue.label(*X) : 0;
        return (1 + bias(x)) * (label > 0 ? organ(*X, label) : around(back * x, 0));
    });
    PhantomImages images;
    if (tissue.cavity_grey) {
        images.cavity = hole_in(tissue, fixed.geometry);
        fixed.voxels.setTo(*tissue.cavity_grey, images.cavity.voxels);
    }
    const Eigen::Matrix3Xd inside = places(tissue, 2000, 0, random).fixed;
    images.view = view_of(inside, after.col(random.index(int(after.cols()))), random.uniform(least_share, most_share));
    images.moving = noisy(moving, noise, random);
    images.fixed = noisy(fixed, noise, random);
    images.partial = within(noisy(fixed, noise, random), images.view);
    images.other_contrast = noisy(other_contrast(fixed), noise, random);
    images.degraded = noisy(thick_slices(other_contrast(fixed)), degraded_noise, random);
    return images;
}

}  // namespace tissuewarp::study::detail
