#pragma once
/// Whether any of many points lies within a radius: points by cubes.

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace tissuewarp::registration::detail {

class NearPoints {
public:
    NearPoints(std::vector<Eigen::Vector3d> points, double radius) : points_(std::move(points)), radius_(radius) {
        if (points_.empty()) return;
        lower_ = points_.front();
        Eigen::Vector3d upper = lower_;
        for (const Eigen::Vector3d& point : points_) {
            lower_ = lower_.cwiseMin(point);
            upper = upper.cwiseMax(point);
        }
        constexpr double most_cubes = 100;  // along an axis
        side_ = std::max(radius, (upper - lower_).maxCoeff() / most_cubes);
        for (Eigen::Index a = 0; a < 3; ++a)
            size_[static_cast<std::size_t>(a)] = 1 + static_cast<int>((upper[a] - lower_[a]) / side_);
        sort_by_cubes();
    }

    /// Thread-safe.
    [[nodiscard]] bool any_about(const Eigen::Vector3d& query) const {
        if (points_.empty()) return false;
        const std::array<int, 3> first = cube_of(query.array() - radius_), last = cube_of(query.array() + radius_);
        for (int k = first[2]; k <= last[2]; ++k)
            for (int j = first[1]; j <= last[1]; ++j)
                for (std::size_t n = begin_[number({first[0], j, k})]; n < begin_[number({last[0], j, k}) + 1]; ++n)
                    if ((points_[n] - query).squaredNorm() < radius_ * radius_) return true;
        return false;
    }

private:
    std::vector<Eigen::Vector3d> points_;  // those of a cube side by side
    double radius_ = 0, side_ = 1;         // mm
    Eigen::Vector3d lower_ = Eigen::Vector3d::Zero();
    std::array<int, 3> size_{1, 1, 1};
    std::vector<std::size_t> begin_;  // of each cube, i fastest, and the end

    [[nodiscard]] std::array<int, 3> cube_of(const Eigen::Array3d& point) const {
        std::array<int, 3> cube{};
        for (std::size_t a = 0; a < 3; ++a) {
            const auto axis = static_cast<Eigen::Index>(a);
            cube[a] =
                static_cast<int>(std::clamp(std::floor((point[axis] - lower_[axis]) / side_), 0.0, size_[a] - 1.0));
        }
        return cube;
    }

    [[nodiscard]] std::size_t number(const std::array<int, 3>& cube) const {
        return static_cast<std::size_t>(cube[0] + size_[0] * (cube[1] + size_[1] * cube[2]));
    }

    void sort_by_cubes() {
        begin_.assign(static_cast<std::size_t>(size_[0] * size_[1] * size_[2]) + 1, 0);
        for (const Eigen::Vector3d& point : points_) ++begin_[number(cube_of(point.array())) + 1];
        for (std::size_t n = 1; n < begin_.size(); ++n) begin_[n] += begin_[n - 1];
        std::vector<std::size_t> next = begin_;
        std::vector<Eigen::Vector3d> sorted(points_.size());
        for (const Eigen::Vector3d& point : points_) sorted[next[number(cube_of(point.array()))]++] = point;
        points_ = std::move(sorted);
    }
};

}  // namespace tissuewarp::registration::detail
