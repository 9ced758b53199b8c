#pragma once
/// Distance from points to a set of triangles, by a uniform grid searched outwards.

#include <Eigen/Core>

#include <array>
#include <vector>

namespace tissuewarp::meshing::detail {

using Triangle = std::array<Eigen::Vector3d, 3>;

/// Distance from a point to a triangle (Ericson, Real-Time Collision Detection, 5.1.5).
double distance(const Eigen::Vector3d& point, const Triangle& triangle);

class TriangleDistance {
public:
    /// `cell` is the edge of the grid's cells, mm: about the size of a triangle. It is raised when
    /// the grid would exceed 256 cells along an axis.
    TriangleDistance(std::vector<Triangle> triangles, double cell);

    /// Distance to the nearest triangle; infinity when there is none. Thread-safe.
    [[nodiscard]] double operator()(const Eigen::Vector3d& point) const;

private:
    [[nodiscard]] Eigen::Array3i cell_of(const Eigen::Vector3d& point) const;

    std::vector<Triangle> triangles_;
    double cell_;
    Eigen::Vector3d lower_;
    std::array<int, 3> cells_{1, 1, 1};
    std::vector<int> offset_, entry_;
};

}  // namespace tissuewarp::meshing::detail
