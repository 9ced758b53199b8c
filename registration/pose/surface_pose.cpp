#include "registration/pose/surface_pose.hpp"

#include "registration/pose/robust_weight.hpp"

#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>
#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

namespace tissuewarp::registration::detail {

namespace {

constexpr SurfacePoseOptions rules;

/// How one descent goes.
struct Descent {
    int points, steps;
    double first_scale_mm, last_scale_mm;
};

class PoseSearch {
public:
    PoseSearch(const meshing::SurfaceTree& model, const meshing::SurfaceMesh& surface, const SurfaceData& data,
               double scale_mm)
        : model_(model), surface_(surface), data_(data), scale_mm_(scale_mm) {
        centre_ = surface.nodes.rowwise().mean();
        radius_ = std::sqrt((surface.nodes.colwise() - centre_).colwise().squaredNorm().mean());
    }

    /// The headers' placement first.
    [[nodiscard]] std::vector<FoundPose> starts() const {
        std::vector<FoundPose> result{{Eigen::Isometry3d::Identity()}};
        const Eigen::Index middle = middle_point();
        const std::vector<int> places = spread_nodes();
        const Eigen::Matrix3Xd normals = meshing::node_normals(surface_);
        for (const Eigen::Matrix3d& rotation : start_rotations(rules.start_rotation_deg)) {
            const Eigen::Vector3d facing = rotation.transpose() * mean_normal(middle);
            for (const int place : places) {
                const double cosine = facing.dot(normals.col(place));
                if ((data_.oriented ? cosine : std::abs(cosine)) < rules.least_cosine) continue;
                Eigen::Isometry3d placement = Eigen::Isometry3d::Identity();
                placement.linear() = rotation;
                placement.translation() = data_.points.col(middle) - rotation * surface_.nodes.col(place);
                result.push_back({placement});
            }
        }
        return result;
    }

    [[nodiscard]] FoundPose descend(FoundPose pose, const Descent& descent) const {
        const Eigen::Index stride = std::max<Eigen::Index>(1, data_.count() / descent.points);
        std::vector<int> nearest(static_cast<std::size_t>((data_.count() + stride - 1) / stride), -1);
        for (int step = 0; step < descent.steps; ++step) {
            const double t = double(step) / std::max(1, descent.steps - 1);
            const double scale = descent.first_scale_mm * std::pow(descent.last_scale_mm / descent.first_scale_mm, t);
            if (!improve(pose.placement, scale, stride, nearest)) break;
        }
        pose.cost = cost(pose.placement, stride, nearest);
        return pose;
    }

private:
    /// Of Gauss–Newton, in the moving frame: a shift, then a rotation about the centre times the radius.
    struct Normals {
        Eigen::Matrix<double, 6, 6> matrix = Eigen::Matrix<double, 6, 6>::Zero();
        Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
        double weights = 0;

        Normals operator+(const Normals& other) const {
            return {matrix + other.matrix, right + other.right, weights + other.weights};
        }
    };

    struct Misfit {
        double sum = 0, areas = 0;

        Misfit operator+(const Misfit& other) const { return {sum + other.sum, areas + other.areas}; }
    };

    const meshing::SurfaceTree& model_;
    const meshing::SurfaceMesh& surface_;
    const SurfaceData& data_;
    double scale_mm_, radius_;
    Eigen::Vector3d centre_;

    /// `nearest`: the triangle of the last match, where there was one.
    [[nodiscard]] std::optional<meshing::SurfaceTree::Hit> match(const Eigen::Vector3d& point,
                                                                 const Eigen::Vector3d& normal, double scale,
                                                                 int& nearest) const {
        const auto hit =
            model_.closest(point, rules.reach * scale, {normal, rules.least_cosine, data_.oriented}, nearest);
        if (hit) nearest = hit->triangle;
        return hit;
    }

    /// A sum over every `stride`-th point, by stretches, whichever threads take them: of[n, nearest].
    template <class Sum, class Of>
    [[nodiscard]] Sum sum(Eigen::Index stride, std::vector<int>& nearest, const Of& of) const {
        constexpr std::size_t stretch = 128;  // points
        return tbb::parallel_deterministic_reduce(
            tbb::blocked_range<std::size_t>(0, nearest.size(), stretch), Sum{},
            [&](const tbb::blocked_range<std::size_t>& range, Sum result) {
                for (std::size_t k = range.begin(); k < range.end(); ++k)
                    of(static_cast<Eigen::Index>(k) * stride, nearest[k], result);
                return result;
            },
            std::plus<>());
    }

    [[nodiscard]] double cost(const Eigen::Isometry3d& placement, Eigen::Index stride,
                              std::vector<int>& nearest) const {
        const Eigen::Isometry3d back = placement.inverse();
        const Misfit misfit = sum<Misfit>(stride, nearest, [&](Eigen::Index n, int& near, Misfit& result) {
            const auto hit = match(back * data_.points.col(n), back.linear() * data_.normals.col(n), scale_mm_, near);
            const double squared = hit ? hit->distance * hit->distance : 0;
            result.sum += data_.areas[n] * (hit ? squared / (squared + scale_mm_ * scale_mm_) : 1);
            result.areas += data_.areas[n];
        });
        return misfit.sum / misfit.areas;
    }

    /// One Gauss–Newton step; false when it changes nothing any more or nothing is near.
    bool improve(Eigen::Isometry3d& placement, double scale, Eigen::Index stride, std::vector<int>& nearest) const {
        const Eigen::Isometry3d back = placement.inverse();
        Normals normals = sum<Normals>(stride, nearest, [&](Eigen::Index n, int& near, Normals& result) {
            const Eigen::Vector3d point = back * data_.points.col(n), normal = back.linear() * data_.normals.col(n);
            const auto hit = match(point, normal, scale, near);
            if (!hit) return;
            const double sign = normal.dot(hit->normal) < 0 ? -1 : 1;
            const Eigen::Vector3d between = (hit->normal + sign * normal).normalized();
            const Eigen::Vector3d arm = 0.5 * (hit->point + point) - centre_;
            Eigen::Matrix<double, 6, 1> row;
            row << between, arm.cross(between) / radius_;
            const double weight = data_.areas[n] * robust_weight(hit->distance, scale);
            result.matrix += weight * row * row.transpose();
            result.right += weight * between.dot(point - hit->point) * row;
            result.weights += weight;
        });
        if (normals.weights <= 0) return false;
        normals.matrix.diagonal().array() += rules.damping * normals.weights;
        const Eigen::Matrix<double, 6, 1> step = normals.matrix.ldlt().solve(normals.right);
        const Eigen::Vector3d rotation = step.tail<3>() / radius_;
        Eigen::Isometry3d moved = Eigen::Isometry3d::Identity();
        if (rotation.norm() > 0)
            moved.linear() = Eigen::AngleAxisd(rotation.norm(), rotation.normalized()).toRotationMatrix();
        moved.translation() = centre_ + step.head<3>() - moved.linear() * centre_;
        placement = placement * moved;
        placement.linear() = Eigen::Quaterniond(placement.linear()).normalized().toRotationMatrix();
        return step.norm() > rules.least_step_mm;
    }

    /// The point closest to the coordinates' medians.
    [[nodiscard]] Eigen::Index middle_point() const {
        Eigen::Vector3d median;
        for (int axis = 0; axis < 3; ++axis) {
            const Eigen::RowVectorXd row = data_.points.row(axis);
            std::vector<double> values(row.begin(), row.end());
            const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
            std::nth_element(values.begin(), middle, values.end());
            median[axis] = *middle;
        }
        Eigen::Index closest = 0;
        (data_.points.colwise() - median).colwise().squaredNorm().minCoeff(&closest);
        return closest;
    }

    /// Of the tenth of the points nearest to one, with the signs of its own normal.
    [[nodiscard]] Eigen::Vector3d mean_normal(Eigen::Index middle) const {
        const Eigen::RowVectorXd squared = (data_.points.colwise() - data_.points.col(middle)).colwise().squaredNorm();
        std::vector<double> sorted(squared.begin(), squared.end());
        const auto tenth = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / rules.facing_one_of);
        std::nth_element(sorted.begin(), tenth, sorted.end());
        Eigen::Vector3d sum = Eigen::Vector3d::Zero();
        for (Eigen::Index n = 0; n < data_.count(); ++n)
            if (squared[n] <= *tenth) {
                const double sign = data_.normals.col(n).dot(data_.normals.col(middle)) < 0 ? -1 : 1;
                sum += data_.areas[n] * (data_.oriented ? 1 : sign) * data_.normals.col(n);
            }
        return sum.normalized();
    }

    /// Nodes far from each other: each the farthest from all before (Gonzalez 1985).
    [[nodiscard]] std::vector<int> spread_nodes() const {
        Eigen::Index node = 0;
        std::vector<int> chosen;
        Eigen::RowVectorXd nearest = Eigen::RowVectorXd::Constant(surface_.node_count(), 1e30);
        for (int n = 0; n < std::min(rules.start_places, surface_.node_count()); ++n) {
            chosen.push_back(static_cast<int>(node));
            nearest = nearest.cwiseMin((surface_.nodes.colwise() - surface_.nodes.col(node)).colwise().squaredNorm());
            nearest.maxCoeff(&node);
        }
        return chosen;
    }
};

void descend_all(const PoseSearch& search, std::vector<FoundPose>& poses, const Descent& descent) {
    tbb::parallel_for(std::size_t{0}, poses.size(),
                      [&](std::size_t i) { poses[i] = search.descend(poses[i], descent); });
}

}  // namespace

SurfacePose search_surface_pose(const meshing::SurfaceTree& model, const meshing::SurfaceMesh& surface,
                                const SurfaceData& data, const AlignmentOptions& options, Observer& observer) {
    const double scale =
        std::max(options.trim_mm / rules.scales_of_trim, rules.least_scale_deviations * data.deviation_mm);
    const PoseSearch search(model, surface, data, scale);
    std::vector<FoundPose> poses = search.starts();
    descend_all(
        search, poses,
        {rules.coarse_points, rules.coarse_steps, rules.coarse_first_scale * scale, rules.coarse_last_scale * scale});
    observer.checkpoint("rigid alignment", 0.6);
    const FoundPose near_headers = poses.front();
    poses = distinct_poses(std::move(poses), surface.nodes, rules.finalists);
    poses.push_back(near_headers);
    const double middle_scale = rules.fine_middle_scale * scale;
    descend_all(search, poses,
                {rules.fine_points, rules.fine_first_steps, rules.fine_first_scale * scale, middle_scale});
    poses = distinct_poses(poses, surface.nodes, poses.size());
    descend_all(search, poses, {rules.fine_points, rules.fine_steps, middle_scale, scale});
    observer.checkpoint("rigid alignment", 1.0);
    return {choose_pose(poses, surface.nodes, Eigen::Isometry3d::Identity()), scale};
}

}  // namespace tissuewarp::registration::detail
