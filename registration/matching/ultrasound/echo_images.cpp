#include "registration/matching/ultrasound/echo_images.hpp"

#include "core/errors.hpp"
#include "imaging/filters.hpp"
#include "registration/field.hpp"
#include "registration/field/mesh_labels.hpp"
#include "registration/matching/descriptors/grid_samples.hpp"
#include "registration/matching/descriptors/matching_grid.hpp"

#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <cmath>

namespace tissuewarp::registration::detail {

namespace {

using imaging::Volume;

std::size_t count_of(const Volume& image) {
    return static_cast<std::size_t>(image.geometry.voxel_count());
}

/// The box of an image about points.
Volume cropped(const Volume& image, const Eigen::Matrix3Xd& points, double margin_mm) {
    const imaging::Geometry& grid = image.geometry;
    const Eigen::Matrix3Xd index = grid.point_to_index() * (points.colwise() - grid.origin);
    std::array<int, 3> lower{}, upper{};
    for (std::size_t a = 0; a < 3; ++a) {
        const auto axis = static_cast<Eigen::Index>(a);
        const double margin = margin_mm / grid.spacing[axis], last = grid.size[a] - 1;
        const double low = std::floor(index.row(axis).minCoeff() - margin),
                     high = std::ceil(index.row(axis).maxCoeff() + margin);
        lower[a] = static_cast<int>(std::clamp(low, 0.0, last));
        upper[a] = static_cast<int>(std::clamp(high, 0.0, last)) + 1;
    }
    return imaging::crop(image, lower, upper);
}

Volume magnitude(const Volume& vectors) {
    Volume result(vectors.geometry, CV_32FC1);
    const auto* v = vectors.data<cv::Vec3f>();
    for (std::size_t n = 0; n < count_of(result); ++n)
        result.data<float>()[n] = std::sqrt(v[n][0] * v[n][0] + v[n][1] * v[n][1] + v[n][2] * v[n][2]);
    return result;
}

/// Smoothed over what is seen alone.
Volume smoothed_within(const Volume& image, const Volume& weight, double deviation_mm) {
    constexpr float least_weight = 1e-3F;
    Volume product = image.clone();
    for (std::size_t n = 0; n < count_of(image); ++n) product.data<float>()[n] *= weight.data<float>()[n];
    Volume result = imaging::smooth(product, deviation_mm);
    const Volume total = imaging::smooth(weight, deviation_mm);
    for (std::size_t n = 0; n < count_of(image); ++n)
        result.data<float>()[n] /= std::max(total.data<float>()[n], least_weight);
    return result;
}

double mean_square(const Volume& image, const Volume& weight) {
    double squares = 0, total = 0;
    for (std::size_t n = 0; n < count_of(image); ++n) {
        const double value = image.data<float>()[n], w = weight.data<float>()[n];
        squares += w * value * value;
        total += w;
    }
    return squares / std::max(total, 1.0);
}

/// Without its slow part, 0 where the weight is.
Volume without_trend(const Volume& image, const Volume& weight, double trend_mm) {
    Volume result = smoothed_within(image, weight, trend_mm);
    for (std::size_t n = 0; n < count_of(image); ++n)
        result.data<float>()[n] = (image.data<float>()[n] - result.data<float>()[n]) * weight.data<float>()[n];
    return result;
}

/// Divided by its deviation nearby.
Volume of_even_amplitude(const Volume& image, const Volume& weight, const EchoImageOptions& options) {
    Volume squares = image.clone();
    cv::multiply(image.voxels, image.voxels, squares.voxels);
    Volume result = smoothed_within(squares, weight, options.trend_mm);
    const double least = options.least_amplitude * std::sqrt(std::max(mean_square(image, weight), 1e-12));
    for (std::size_t n = 0; n < count_of(image); ++n) {
        const double deviation = std::sqrt(std::max(0.F, result.data<float>()[n]));
        result.data<float>()[n] = image.data<float>()[n] / static_cast<float>(std::max(deviation, least));
    }
    return result;
}

std::vector<float> values_of(const Volume& image) {
    return {image.data<float>(), image.data<float>() + count_of(image)};
}

/// Of deviation 1 where the weight is.
std::vector<float> normalised(const Volume& image, const Volume& weight) {
    std::vector<float> result = values_of(image);
    const auto scale = static_cast<float>(1 / std::sqrt(std::max(mean_square(image, weight), 1e-12)));
    for (float& value : result) value *= scale;
    return result;
}

/// 1 for voxels in the mesh or near it.
Volume near_mesh(const meshing::TetMesh& mesh, const imaging::Geometry& grid, double outside_mm) {
    return imaging::dilate(mask_of_mesh(mesh, grid), outside_mm);
}

/// Voxel centres of what is seen, every `step`-th along each axis.
Eigen::Matrix3Xd places_seen(const Volume& seen, int step) {
    const auto& size = seen.geometry.size;
    std::vector<Eigen::Vector3d> places;
    for (int k = 0; k < size[2]; k += step)
        for (int j = 0; j < size[1]; j += step)
            for (int i = 0; i < size[0]; i += step)
                if (seen.data<std::uint8_t>()[seen.offset(i, j, k)])
                    places.push_back(seen.geometry.point({double(i), double(j), double(k)}));
    Eigen::Matrix3Xd result(3, static_cast<Eigen::Index>(places.size()));
    for (std::size_t n = 0; n < places.size(); ++n) result.col(static_cast<Eigen::Index>(n)) = places[n];
    return result;
}

/// Voxel centres of what is seen, thinned where that leaves enough: a slab of a voxel or two lies between them.
/// Throws InvalidInput where there are none.
Eigen::Matrix3Xd places_seen(const Volume& seen) {
    constexpr int thinned = 4, enough = 1000;
    Eigen::Matrix3Xd places = places_seen(seen, thinned);
    if (places.cols() < enough) places = places_seen(seen, 1);
    if (places.cols() == 0) throw InvalidInput("the ultrasound shows nothing: all of it has one value");
    return places;
}

/// A grid about what is seen, and no wider than the model needs.
imaging::Geometry working_grid(const Eigen::Matrix3Xd& seen, const meshing::TetMesh& mesh,
                               const Eigen::Matrix3d& direction, double spacing_mm, double margin_mm) {
    const Eigen::Matrix3Xd at = direction.transpose() * seen, nodes = direction.transpose() * mesh.nodes;
    const Eigen::Vector3d lower = at.rowwise().minCoeff().cwiseMax(nodes.rowwise().minCoeff()),
                          upper = at.rowwise().maxCoeff().cwiseMin(nodes.rowwise().maxCoeff());
    if (!(upper.array() > lower.array()).all())
        throw InvalidInput("the ultrasound shows nothing of the organ; check their headers, or align them first");
    Eigen::Matrix3Xd corners(3, 2);
    corners << lower, upper;
    return grid_about(direction * corners, direction, spacing_mm, margin_mm);
}

}  // namespace

EchoSource::EchoSource(const meshing::TetMesh& mesh, const Volume& moving, const SeenImage& fixed,
                       const EchoImageOptions& options)
    : mesh_(mesh),
      fixed_(fixed),
      options_(options),
      grey_(imaging::smooth(cropped(moving, mesh.nodes, options.margin_mm), options.moving_mm)),
      gradient_(magnitude(imaging::gradient(grey_))) {}

const EchoSource::Level& EchoSource::level(double spacing_mm) {
    const auto known = levels_.find(spacing_mm);
    if (known != levels_.end()) return known->second;
    const double for_grid = working_deviation(spacing_mm);
    const Volume weight = fixed_.seen.as(CV_32F);
    Level level{smoothed_within(fixed_.image, weight, std::max(options_.speckle_mm, for_grid)),
                imaging::smooth(grey_, for_grid), imaging::smooth(gradient_, for_grid)};
    return levels_.emplace(spacing_mm, std::move(level)).first->second;
}

EchoImages EchoSource::on_grid(const State& state, double spacing_mm, double margin_mm) {
    const Level& level = this->level(spacing_mm);
    const Eigen::Matrix3Xd seen = state.placement.inverse() * places_seen(fixed_.seen);
    const imaging::Geometry grid = working_grid(seen, mesh_, grey_.geometry.direction, spacing_mm, margin_mm);
    const Volume field =
        displacement_near_mesh({mesh_, state.displacement, state.placement}, GridSamples::with_rim(grid),
                               static_cast<int>(std::ceil(margin_mm / spacing_mm)));
    const GridSamples samples(level.echo, fixed_.seen, grid, SearchRegion(grid), field);
    EchoImages result{grid, {}, {}, {}, {}, {}};
    const Volume counts = near_mesh(mesh_, grid, options_.outside_mm);
    Volume echo(grid, CV_32FC1), weight(grid, CV_32FC1), shown(grey_.geometry, CV_32FC1);
    std::size_t n = 0;
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i, ++n) {
                weight.data<float>()[n] = *samples.seen(i, j, k) && counts.data<std::uint8_t>()[n] ? 1.F : 0.F;
                echo.data<float>()[n] = *samples.value(i, j, k) * weight.data<float>()[n];
            }
    shown.voxels = 1;
    shown = imaging::resample(shown, grid, imaging::Interpolation::Nearest);
    const auto prepared = [&](const Volume& image) {
        return normalised(
            without_trend(imaging::resample(image, grid, imaging::Interpolation::Linear), shown, options_.trend_mm),
            shown);
    };
    result.seen = values_of(weight);
    result.shown = values_of(shown);
    tbb::parallel_invoke(
        [&] {
            const Volume flat = without_trend(echo, weight, options_.trend_mm);
            result.echo = values_of(of_even_amplitude(flat, weight, options_));
        },
        [&] { result.grey = prepared(level.grey); }, [&] { result.gradient = prepared(level.gradient); });
    return result;
}

}  // namespace tissuewarp::registration::detail
