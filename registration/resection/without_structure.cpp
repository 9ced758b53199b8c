#include "registration/resection/without_structure.hpp"

#include "imaging/filters.hpp"
#include "imaging/foreground.hpp"
#include "imaging/labels.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

namespace tissuewarp::registration::detail {

using Eigen::Vector3d;
using imaging::Volume;

int voxels_of_half(double half_mm, const imaging::Geometry& grid, std::size_t axis) {
    return std::max(1, static_cast<int>(std::lround(half_mm / grid.spacing[static_cast<Eigen::Index>(axis)])));
}

Volume box_mean(const Volume& image, double half_mm) {
    Volume result = image.clone();
    const auto& size = image.geometry.size;
    const std::array<std::int64_t, 3> stride{1, size[0], std::int64_t{size[0]} * size[1]};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
        const int half = voxels_of_half(half_mm, image.geometry, axis), last = size[axis] - 1;
        tbb::parallel_for(0, size[v], [&](int b) {
            std::vector<double> line(static_cast<std::size_t>(size[axis]));
            for (int a = 0; a < size[u]; ++a) {
                float* first = result.data<float>() + stride[u] * a + stride[v] * b;
                for (int n = 0; n <= last; ++n) line[static_cast<std::size_t>(n)] = first[stride[axis] * n];
                const auto at = [&](int n) { return line[static_cast<std::size_t>(std::clamp(n, 0, last))]; };
                double sum = 0;
                for (int n = -half; n <= half; ++n) sum += at(n);
                for (int n = 0; n <= last; ++n) {
                    first[stride[axis] * n] = static_cast<float>(sum / (2 * half + 1));
                    sum += at(n + half + 1) - at(n - half);
                }
            }
        });
    }
    return result;
}

CavityView::CavityView(const Volume& image, Volume whole, const Volume& tissue)
    : organ(std::move(whole)),
      grey(against_noise(imaging::resample(image, organ.geometry, imaging::Interpolation::Linear).as(CV_32F))),
      deviation(local_deviation(grey)),
      tissue_deviation(median(values_in(deviation, tissue))) {}

CavityView::CavityView(Volume whole, Volume its_grey, Volume its_deviation, double of_tissue)
    : organ(std::move(whole)),
      grey(std::move(its_grey)),
      deviation(std::move(its_deviation)),
      tissue_deviation(of_tissue) {}

imaging::Geometry grid_about(const imaging::Geometry& image, const Eigen::Matrix3Xd& points, double margin_mm) {
    imaging::Geometry grid = image;
    grid.spacing = image.spacing.cwiseMax(cavity_options.grid_mm);
    const Eigen::Matrix3Xd along = image.direction.transpose() * points;
    const Vector3d lower = along.rowwise().minCoeff().array() - margin_mm,
                   upper = along.rowwise().maxCoeff().array() + margin_mm;
    grid.origin = image.direction * lower;
    for (Eigen::Index axis = 0; axis < 3; ++axis)
        grid.size[static_cast<std::size_t>(axis)] =
            1 + static_cast<int>(std::ceil((upper[axis] - lower[axis]) / grid.spacing[axis]));
    return grid;
}

Volume against_noise(const Volume& image) {
    constexpr double smoothing_mm = 0.7;
    return imaging::smooth(image, smoothing_mm);
}

Volume local_deviation(const Volume& image) {
    constexpr double half = cavity_options.window_mm;
    Volume centred = image.clone();  // of large means little would be left of squares in float32
    centred.voxels -= cv::mean(image.voxels.reshape(1, 1));
    Volume squares = centred.clone();
    cv::multiply(centred.voxels, centred.voxels, squares.voxels);
    const Volume mean = box_mean(centred, half);
    Volume result = box_mean(squares, half);
    auto* value = result.data<float>();
    for (std::int64_t n = 0; n < result.geometry.voxel_count(); ++n)
        value[n] = std::sqrt(std::max(0.0F, value[n] - mean.data<float>()[n] * mean.data<float>()[n]));
    return result;
}

std::vector<float> values_in(const Volume& image, const Volume& mask) {
    std::vector<float> values;
    for (std::int64_t n = 0; n < image.geometry.voxel_count(); ++n)
        if (mask.data<std::uint8_t>()[n]) values.push_back(image.data<float>()[n]);
    return values;
}

double median(std::vector<float> values) {
    if (values.empty()) return 0;
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

Spread spread_of(const std::vector<float>& values) {
    constexpr double of_normal = 1.4826;
    const double middle = median(values);
    std::vector<float> off = values;
    for (float& value : off) value = std::abs(value - float(middle));
    return {middle, of_normal * median(std::move(off))};
}

std::vector<Volume> pieces_of(const Volume& mask, double least_ml) {
    const Volume numbered = imaging::connected_components(mask);
    std::vector<Volume> pieces;
    for (const int piece : imaging::labels_in(numbered)) {
        Volume one = imaging::mask_of(numbered, piece);
        if (imaging::millilitres(one) < least_ml) break;
        pieces.push_back(std::move(one));
    }
    return pieces;
}

Volume up_to_wall(const CavityView& view, const Volume& piece) {
    constexpr CavityOptions options = cavity_options;
    constexpr double within_deviations = 4;
    const auto [grey, deviation] = spread_of(values_in(view.grey, piece));
    const Volume near = imaging::dilate(piece, options.reach_mm);
    Volume around = imaging::dilate(near, options.reach_mm);
    around.voxels &= ~near.voxels & view.organ.voxels;
    const double halfway = 0.5 * std::abs(median(values_in(view.grey, around)) - grey),
                 most = std::max({within_deviations * deviation, view.tissue_deviation, halfway});
    Volume like(piece.geometry, CV_8UC1);
    for (std::int64_t n = 0; n < piece.geometry.voxel_count(); ++n)
        like.data<std::uint8_t>()[n] =
            piece.data<std::uint8_t>()[n] || (near.data<std::uint8_t>()[n] && view.organ.data<std::uint8_t>()[n] &&
                                              std::abs(view.grey.data<float>()[n] - grey) < most);
    return imaging::without_holes(imaging::largest_component(imaging::open(like, options.opening_mm)));
}

}  // namespace tissuewarp::registration::detail
