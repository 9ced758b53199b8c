#include "registration/pose/label_distance.hpp"

#include "core/errors.hpp"
#include "imaging/filters.hpp"
#include "imaging/labels.hpp"
#include "registration/pose/alignment.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

namespace tissuewarp::registration::detail {

namespace {

using imaging::Geometry;
using imaging::Volume;

constexpr int union_label = 0;  // stands for the boundary of all labels together
constexpr int most_labels = LabelPoseOptions().most_labels;

/// The union and the largest labels that both maps hold.
std::vector<int> labels_to_align(const Volume& moving, const Volume& fixed) {
    const auto moving_statistics = imaging::label_statistics(moving);
    const auto fixed_statistics = imaging::label_statistics(fixed);
    std::vector<std::pair<double, int>> common;
    for (const auto& [label, statistics] : moving_statistics)
        if (fixed_statistics.contains(label)) common.emplace_back(-statistics.volume_mm3, label);
    if (common.empty()) throw InvalidInput("the moving and the fixed label map share no label; check the label tables");
    std::sort(common.begin(), common.end());
    std::vector<int> labels{union_label};
    for (std::size_t i = 0; i < common.size() && i < most_labels && common.size() > 1; ++i)
        labels.push_back(common[i].second);
    return labels;
}

Volume mask(const Volume& labels, int label) {
    return label == union_label ? imaging::mask_of_all(labels) : imaging::mask_of(labels, label);
}

/// Every n-th of the face centres between the mask and its outside, so that at most `most` remain.
Eigen::Matrix3Xd boundary_points(const Volume& mask, int most) {
    const auto& size = mask.geometry.size;
    std::vector<Eigen::Vector3d> centres;
    const auto* voxels = mask.data<std::uint8_t>();
    const std::int64_t per_row = size[0], per_slice = per_row * size[1];
    for (int k = 0; k < size[2]; ++k)
        for (int j = 0; j < size[1]; ++j) {
            const std::uint8_t* row = voxels + mask.offset(0, j, k);
            // Beyond the grid itself: no face.
            const std::uint8_t* beside = j + 1 < size[1] ? row + per_row : row;
            const std::uint8_t* above = k + 1 < size[2] ? row + per_slice : row;
            for (int i = 0; i < size[0]; ++i) {
                const bool here = row[i] != 0;
                const std::array<bool, 3> face{(row[std::min(i + 1, size[0] - 1)] != 0) != here,
                                               (beside[i] != 0) != here, (above[i] != 0) != here};
                if (!face[0] && !face[1] && !face[2]) continue;
                for (std::size_t axis = 0; axis < 3; ++axis) {
                    if (!face[axis]) continue;
                    Eigen::Vector3d index(i, j, k);
                    index[static_cast<Eigen::Index>(axis)] += 0.5;
                    centres.push_back(mask.geometry.point(index));
                }
            }
        }
    const std::size_t stride = std::max<std::size_t>(
        1, (centres.size() + static_cast<std::size_t>(most) - 1) / static_cast<std::size_t>(most));
    Eigen::Matrix3Xd points(3, static_cast<Eigen::Index>((centres.size() + stride - 1) / stride));
    for (std::size_t i = 0; i < centres.size(); i += stride)
        points.col(static_cast<Eigen::Index>(i / stride)) = centres[i];
    return points;
}

}  // namespace

Volume coarsened(const Volume& labels, double spacing_mm) {
    Geometry grid = labels.geometry;
    for (int axis = 0; axis < 3; ++axis) {
        const double factor = std::max(1.0, std::floor(spacing_mm / grid.spacing[axis]));  // whole: no aliasing
        grid.size[static_cast<std::size_t>(axis)] =
            static_cast<int>(std::ceil(grid.size[static_cast<std::size_t>(axis)] / factor));
        grid.spacing[axis] *= factor;
    }
    return imaging::resample(labels.as(CV_32S), grid, imaging::Interpolation::Nearest);
}

BoundaryDistances::BoundaryDistances(const Volume& points_from, const Volume& maps_from, const std::vector<int>& labels,
                                     int samples) {
    const Volume coarse = coarsened(maps_from, LabelPoseOptions().map_spacing_mm);
    struct Boundary {
        Volume map;
        Eigen::Matrix3Xd points;
    };
    std::vector<std::optional<Boundary>> boundaries(labels.size());
    tbb::parallel_for(std::size_t{0}, labels.size(), [&](std::size_t n) {
        const Volume inside = mask(coarse, labels[n]);
        if (cv::countNonZero(inside.voxels.reshape(1, 1)) == 0) return;
        boundaries[n] = {imaging::signed_distance(inside),
                         boundary_points(mask(points_from, labels[n]), samples / static_cast<int>(labels.size()))};
    });
    for (auto& boundary : boundaries) {
        if (!boundary) continue;
        maps_.push_back(std::move(boundary->map));
        points_.push_back(std::move(boundary->points));
    }
    for (const Volume& map : maps_) samplers_.emplace_back(map);
}

double BoundaryDistances::mean(const Eigen::Affine3d& map, double trim, int stride) const {
    double sum = 0;
    long count = 0;
    for (std::size_t label = 0; label < points_.size(); ++label)
        for (Eigen::Index i = 0; i < points_[label].cols(); i += stride, ++count) {
            const Eigen::Vector3d point = map * points_[label].col(i);
            sum += std::min(trim, std::abs(double(samplers_[label].value(point))) + outside(label, point));
        }
    return sum / double(std::max(1l, count));
}

/// Distance from the point to the grid of the map, mm: samplers clamp, the cost must keep growing.
double BoundaryDistances::outside(std::size_t label, const Eigen::Vector3d& point) const {
    const Geometry& grid = maps_[label].geometry;
    const Eigen::Vector3d index = grid.index(point);
    double squared = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const double over =
            std::max({0.0, -index[axis], index[axis] - (grid.size[static_cast<std::size_t>(axis)] - 1)});
        squared += std::pow(over * grid.spacing[axis], 2);
    }
    return std::sqrt(squared);
}

LabelDistance::LabelDistance(const Volume& moving, const Volume& fixed, int samples)
    : LabelDistance(moving, fixed, labels_to_align(moving, fixed), samples / 2) {}

LabelDistance::LabelDistance(const Volume& moving, const Volume& fixed, const std::vector<int>& labels, int samples)
    : forward(moving, fixed, labels, samples), backward(fixed, moving, labels, samples) {}

}  // namespace tissuewarp::registration::detail
