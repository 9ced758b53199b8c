#include "registration/alignment.hpp"

#include "imaging/filters.hpp"
#include "imaging/labels.hpp"
#include "imaging/sampling.hpp"

#include <tbb/parallel_for.h>
#include <nlopt.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

namespace tissuewarp::registration {

namespace {

using imaging::Geometry;
using imaging::Volume;

constexpr int union_label = 0;  // stands for the boundary of all labels together
constexpr int most_labels = 4;  // the largest ones; many small structures add time, not certainty
constexpr double map_spacing =
    2.0;  // mm, of the distance maps: linear interpolation in them is good to a fraction of it

/// Copies a label map to int32 whatever its integer type.
Volume as_int(const Volume& labels) {
    return labels.as(CV_32S);
}

/// The label map on a coarser isotropic grid that covers it, for distance maps.
Volume coarsened(const Volume& labels) {
    Geometry grid = labels.geometry;
    for (int axis = 0; axis < 3; ++axis) {
        const double factor = std::max(1.0, map_spacing / grid.spacing[axis]);
        grid.size[static_cast<std::size_t>(axis)] =
            static_cast<int>(std::ceil(grid.size[static_cast<std::size_t>(axis)] / factor));
        grid.spacing[axis] *= factor;
    }
    return imaging::resample(labels, grid, imaging::Interpolation::Nearest);
}

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
    for (int k = 0; k < size[2]; ++k)
        for (int j = 0; j < size[1]; ++j)
            for (int i = 0; i < size[0]; ++i) {
                const bool here = voxels[mask.offset(i, j, k)] != 0;
                const std::array<std::array<int, 3>, 3> next{{{i + 1, j, k}, {i, j + 1, k}, {i, j, k + 1}}};
                for (std::size_t axis = 0; axis < 3; ++axis) {
                    if (next[axis][axis] >= size[axis]) continue;
                    const bool there = voxels[mask.offset(next[axis][0], next[axis][1], next[axis][2])] != 0;
                    if (here == there) continue;
                    Eigen::Vector3d index(i, j, k);
                    index[static_cast<Eigen::Index>(axis)] += 0.5;
                    centres.push_back(mask.geometry.point(index));
                }
            }
    const std::size_t stride = std::max<std::size_t>(
        1, (centres.size() + static_cast<std::size_t>(most) - 1) / static_cast<std::size_t>(most));
    Eigen::Matrix3Xd points(3, static_cast<Eigen::Index>((centres.size() + stride - 1) / stride));
    for (std::size_t i = 0; i < centres.size(); i += stride)
        points.col(static_cast<Eigen::Index>(i / stride)) = centres[i];
    return points;
}

/// Rigid motion from six numbers, all in mm: translation, and rotation vector about `centre` times `radius`.
struct PoseSpace {
    Eigen::Vector3d centre;
    double radius = 1;

    [[nodiscard]] Eigen::Isometry3d pose(const double* x) const {
        const Eigen::Vector3d rotation = Eigen::Vector3d(x[3], x[4], x[5]) / radius;
        const double angle = rotation.norm();
        Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
        if (angle > 0) result.linear() = Eigen::AngleAxisd(angle, rotation / angle).toRotationMatrix();
        result.translation() = centre + Eigen::Vector3d(x[0], x[1], x[2]) - result.linear() * centre;
        return result;
    }
};

class DistanceCost {
public:
    DistanceCost(const Volume& moving, const Volume& fixed, int samples) {
        const std::vector<int> labels = labels_to_align(moving, fixed);
        const Volume coarse_fixed = coarsened(fixed);
        for (const int label : labels) {
            const Volume fixed_mask = mask(coarse_fixed, label);
            if (cv::countNonZero(fixed_mask.voxels.reshape(1, 1)) == 0) continue;
            maps_.push_back(imaging::signed_distance(fixed_mask));
            points_.push_back(boundary_points(mask(moving, label), samples / static_cast<int>(labels.size())));
        }
        for (const Volume& map : maps_) samplers_.emplace_back(map);
    }

    /// Mean of min(|distance|, trim) over every `stride`-th point.
    [[nodiscard]] double operator()(const Eigen::Isometry3d& pose, double trim, int stride) const {
        double sum = 0;
        long count = 0;
        for (std::size_t label = 0; label < points_.size(); ++label)
            for (Eigen::Index i = 0; i < points_[label].cols(); i += stride, ++count) {
                const Eigen::Vector3d point = pose * points_[label].col(i);
                sum += std::min(trim, std::abs(double(samplers_[label].value(point))) + outside(label, point));
            }
        return sum / double(std::max(1l, count));
    }

    [[nodiscard]] Eigen::Vector3d centroid_of_points() const { return points_.front().rowwise().mean(); }
    [[nodiscard]] double radius() const {
        return std::sqrt((points_.front().colwise() - centroid_of_points()).colwise().squaredNorm().mean());
    }

private:
    std::vector<Volume> maps_;
    std::vector<imaging::LinearSampler> samplers_;
    std::vector<Eigen::Matrix3Xd> points_;

    /// Distance from the point to the grid of the map, mm: samplers clamp, the cost must keep growing.
    [[nodiscard]] double outside(std::size_t label, const Eigen::Vector3d& point) const {
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
};

struct Pose {
    std::array<double, 6> x{};
    double cost = 0;
};

Pose minimise(const DistanceCost& cost, const PoseSpace& space, Pose start, double trim, int stride, int evaluations) {
    struct Problem {
        const DistanceCost& cost;
        const PoseSpace& space;
        double trim;
        int stride;
    } problem{cost, space, trim, stride};
    nlopt::opt optimiser(nlopt::LN_BOBYQA, 6);
    optimiser.set_min_objective(
        [](unsigned, const double* x, double*, void* data) {
            const auto& p = *static_cast<const Problem*>(data);
            return p.cost(p.space.pose(x), p.trim, p.stride);
        },
        &problem);
    optimiser.set_initial_step(std::max(0.5, trim / 4));
    optimiser.set_xtol_abs(0.01);
    optimiser.set_maxeval(evaluations);
    std::vector<double> x(start.x.begin(), start.x.end());
    try {
        optimiser.optimize(x, start.cost);
    } catch (const nlopt::roundoff_limited&) {
        // The best point so far is in x: as good as this cost can be resolved.
    }
    std::copy(x.begin(), x.end(), start.x.begin());
    start.cost = cost(space.pose(start.x.data()), trim, stride);
    return start;
}

std::vector<Pose> starting_poses(const PoseSpace& space, const Eigen::Vector3d& fixed_centroid, double angle) {
    const Eigen::Vector3d shift = fixed_centroid - space.centre;
    std::vector<Pose> starts(2);
    std::copy(shift.begin(), shift.end(), starts[1].x.begin());
    for (std::size_t axis = 3; axis < 6; ++axis)
        for (const double sign : {-1.0, 1.0}) {
            Pose turned = starts[1];
            turned.x[axis] = sign * angle * space.radius;
            starts.push_back(turned);
        }
    return starts;
}

}  // namespace

Alignment align_labels(const Volume& moving_labels, const Volume& fixed_labels, const AlignmentOptions& options,
                       Observer& observer) {
    const Volume moving = as_int(moving_labels), fixed = as_int(fixed_labels);
    const DistanceCost cost(moving, fixed, options.samples);
    const PoseSpace space{cost.centroid_of_points(), cost.radius()};
    const Volume fixed_mask = imaging::mask_of_all(fixed);
    const Eigen::Vector3d fixed_centroid = boundary_points(fixed_mask, options.samples).rowwise().mean();

    std::vector<Pose> poses = starting_poses(space, fixed_centroid, options.start_angle_deg * EIGEN_PI / 180);
    constexpr int coarse_stride = 8;
    tbb::parallel_for(std::size_t{0}, poses.size(), [&](std::size_t i) {
        poses[i] = minimise(cost, space, poses[i], 10 * options.trim_mm, coarse_stride, 150);
    });
    observer.checkpoint("rigid alignment", 0.6);
    std::stable_sort(poses.begin(), poses.end(), [](const Pose& a, const Pose& b) { return a.cost < b.cost; });
    poses.resize(2);
    tbb::parallel_for(std::size_t{0}, poses.size(),
                      [&](std::size_t i) { poses[i] = minimise(cost, space, poses[i], options.trim_mm, 1, 400); });
    observer.checkpoint("rigid alignment", 1.0);
    const Pose& best = poses[1].cost < poses[0].cost ? poses[1] : poses[0];
    return {space.pose(best.x.data()), best.cost};
}

}  // namespace tissuewarp::registration
