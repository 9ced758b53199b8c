#include "registration/pose/label_boundaries.hpp"

#include "imaging/filters.hpp"
#include "imaging/labels.hpp"
#include "registration/pose/alignment.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

namespace tissuewarp::registration::detail {

namespace {

using imaging::Geometry;
using imaging::LabelExtent;
using imaging::Volume;

constexpr double beyond_mm = 60;  // of the labels: farther off distances grow by those to the grid. By hand

/// Voxels of the map in one of the coarser grid, along each axis: whole, so that labels keep their places.
std::array<int, 3> coarsening(const Geometry& grid, double spacing_mm) {
    std::array<int, 3> step{};
    for (int axis = 0; axis < 3; ++axis)
        step[static_cast<std::size_t>(axis)] =
            std::max(1, static_cast<int>(std::floor(spacing_mm / grid.spacing[axis])));
    return step;
}

Volume mask(const Volume& labels, int label) {
    return label == LabelBoundaries::of_all ? imaging::mask_of_all(labels) : imaging::mask_of(labels, label);
}

/// Centres of the faces between the mask and its outside, in the order of the grid.
Eigen::Matrix3Xd faces_of(const Volume& mask) {
    const auto& size = mask.geometry.size;
    const std::int64_t per_row = size[0], per_slice = per_row * size[1];
    std::vector<std::vector<Eigen::Vector3d>> of_slice(static_cast<std::size_t>(size[2]));
    tbb::parallel_for(0, size[2], [&](int k) {
        for (int j = 0; j < size[1]; ++j) {
            const std::uint8_t* row = mask.data<std::uint8_t>() + mask.offset(0, j, k);
            // Beyond the grid itself: no face.
            const std::uint8_t* beside = j + 1 < size[1] ? row + per_row : row;
            const std::uint8_t* above = k + 1 < size[2] ? row + per_slice : row;
            for (int i = 0; i < size[0]; ++i) {
                const bool here = row[i] != 0;
                const std::array<bool, 3> face{(row[std::min(i + 1, size[0] - 1)] != 0) != here,
                                               (beside[i] != 0) != here, (above[i] != 0) != here};
                for (int axis = 0; axis < 3; ++axis) {
                    if (!face[static_cast<std::size_t>(axis)]) continue;
                    Eigen::Vector3d index(i, j, k);
                    index[axis] += 0.5;
                    of_slice[static_cast<std::size_t>(k)].push_back(mask.geometry.point(index));
                }
            }
        }
    });
    Eigen::Index count = 0;
    for (const auto& slice : of_slice) count += static_cast<Eigen::Index>(slice.size());
    Eigen::Matrix3Xd faces(3, count);
    Eigen::Index next = 0;
    for (const auto& slice : of_slice)
        for (const Eigen::Vector3d& centre : slice) faces.col(next++) = centre;
    return faces;
}

}  // namespace

Volume coarsened(const Volume& labels, double spacing_mm) {
    return coarsened(labels, {0, {0, 0, 0}, labels.geometry.size}, spacing_mm);
}

Volume coarsened(const Volume& labels, LabelExtent box, double spacing_mm) {
    const std::array<int, 3> step = coarsening(labels.geometry, spacing_mm);
    for (std::size_t axis = 0; axis < 3; ++axis) box.lower[axis] -= box.lower[axis] % step[axis];
    return part_of(labels, box, step);
}

std::array<int, 3> voxels_of(double length_mm, const Geometry& grid) {
    std::array<int, 3> count{};
    for (int axis = 0; axis < 3; ++axis)
        count[static_cast<std::size_t>(axis)] = static_cast<int>(std::ceil(length_mm / grid.spacing[axis]));
    return count;
}

Eigen::Matrix3Xd thinned(const Eigen::Matrix3Xd& points, Eigen::Index most) {
    const Eigen::Index stride = std::max<Eigen::Index>(1, (points.cols() + most - 1) / most);
    return points(Eigen::all, Eigen::seq(0, points.cols() - 1, stride));
}

double labelled_volume(const imaging::LabelExtents& extents, const Geometry& grid) {
    return double(extent_of_all(extents).voxels) * grid.voxel_volume();
}

LabelBoundaries::LabelBoundaries(const Volume& labels, double spacing_mm)
    : labels_(labels), spacing_mm_(spacing_mm), extents_(imaging::label_extents(labels)) {}

Volume LabelBoundaries::coarse_about_all() const {
    const Geometry& grid = labels_.geometry;
    return coarsened(labels_, grown(extent_of_all(extents_), voxels_of(beyond_mm, grid), grid), spacing_mm_);
}

LabelBoundaries::Boundary LabelBoundaries::boundary(const Volume& coarse, int label) const {
    const Volume inside = mask(coarse, label);
    if (cv::countNonZero(inside.voxels.reshape(1, 1)) == 0) return {};
    const LabelExtent extent = label == of_all ? extent_of_all(extents_) : extents_.at(label);
    return {imaging::signed_distance(inside),
            faces_of(mask_in(labels_, grown(extent, {1, 1, 1}, labels_.geometry), label))};
}

void LabelBoundaries::make(const std::vector<int>& labels) {
    std::vector<int> missing;
    for (const int label : labels)
        if (!made_.contains(label)) missing.push_back(label);
    if (missing.empty()) return;
    const Volume coarse = coarse_about_all();
    std::vector<Boundary> boundaries(missing.size());
    tbb::parallel_for(std::size_t{0}, missing.size(),
                      [&](std::size_t n) { boundaries[n] = boundary(coarse, missing[n]); });
    for (std::size_t n = 0; n < missing.size(); ++n) made_.emplace(missing[n], std::move(boundaries[n]));
}

}  // namespace tissuewarp::registration::detail
