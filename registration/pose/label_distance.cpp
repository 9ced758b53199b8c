#include "registration/pose/label_distance.hpp"

#include "core/errors.hpp"
#include "registration/pose/alignment.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace tissuewarp::registration::detail {

namespace {

/// All together and the largest labels that both maps hold, made by both.
std::vector<int> labels_to_align(LabelBoundaries& moving, LabelBoundaries& fixed) {
    constexpr std::size_t most_labels = LabelPoseOptions().most_labels;
    std::vector<std::pair<std::int64_t, int>> common;
    for (const auto& [label, extent] : moving.extents())
        if (fixed.extents().contains(label)) common.emplace_back(-extent.voxels, label);
    if (common.empty()) throw InvalidInput("the moving and the fixed label map share no label; check the label tables");
    std::sort(common.begin(), common.end());
    std::vector<int> labels{LabelBoundaries::of_all};
    for (std::size_t i = 0; i < common.size() && i < most_labels && common.size() > 1; ++i)
        labels.push_back(common[i].second);
    moving.make(labels);
    fixed.make(labels);
    return labels;
}

}  // namespace

BoundaryDistances::BoundaryDistances(const LabelBoundaries& points_from, const LabelBoundaries& distances_from,
                                     const std::vector<int>& labels, int samples) {
    const auto most = static_cast<Eigen::Index>(samples / static_cast<int>(labels.size()));
    for (const int label : labels) {
        const imaging::Volume& distance = distances_from.of(label).distance;
        const Eigen::Matrix3Xd& faces = points_from.of(label).faces;
        if (distance.empty() || faces.cols() == 0) continue;
        grids_.push_back(&distance.geometry);
        samplers_.emplace_back(distance);
        points_.push_back(thinned(faces, most));
    }
}

double BoundaryDistances::mean(const Eigen::Affine3d& map, double trim, int stride) const {
    constexpr Eigen::Index at_once = 256;
    std::vector<Share> shares;
    long count = 0;
    for (std::size_t label = 0; label < points_.size(); ++label)
        for (Eigen::Index first = 0, points = points_[label].cols(); first < points; first += at_once * stride) {
            shares.push_back({label, first, std::min(points, first + at_once * stride)});
            count += (shares.back().last - first + stride - 1) / stride;
        }
    std::vector<double> sums(shares.size());
    tbb::parallel_for(std::size_t{0}, shares.size(),
                      [&](std::size_t n) { sums[n] = sum(shares[n], map, trim, stride); });
    double all = 0;
    for (const double part : sums) all += part;
    return all / double(std::max(1l, count));
}

double BoundaryDistances::sum(const Share& share, const Eigen::Affine3d& map, double trim, int stride) const {
    double sum = 0;
    for (Eigen::Index i = share.first; i < share.last; i += stride) {
        const Eigen::Vector3d point = map * points_[share.label].col(i);
        sum += std::min(trim, std::abs(double(samplers_[share.label].value(point))) + outside(share.label, point));
    }
    return sum;
}

/// Distance from the point to the grid of the map, mm: samplers clamp, the cost must keep growing.
double BoundaryDistances::outside(std::size_t label, const Eigen::Vector3d& point) const {
    const imaging::Geometry& grid = *grids_[label];
    const Eigen::Vector3d index = grid.index(point);
    double squared = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const double over =
            std::max({0.0, -index[axis], index[axis] - (grid.size[static_cast<std::size_t>(axis)] - 1)});
        squared += std::pow(over * grid.spacing[axis], 2);
    }
    return std::sqrt(squared);
}

LabelDistance::LabelDistance(LabelBoundaries& moving, LabelBoundaries& fixed, int samples)
    : LabelDistance(moving, fixed, labels_to_align(moving, fixed), samples / 2) {}

LabelDistance::LabelDistance(const LabelBoundaries& moving, const LabelBoundaries& fixed,
                             const std::vector<int>& labels, int samples)
    : forward(moving, fixed, labels, samples), backward(fixed, moving, labels, samples) {}

}  // namespace tissuewarp::registration::detail
