#pragma once
/// Finding the tetrahedron that holds a point.

#include "meshing/tet_mesh.hpp"

#include <Eigen/Core>

#include <array>
#include <optional>
#include <vector>

namespace tissuewarp::meshing {

struct Location {
    int tet = -1;
    Eigen::Vector4d barycentric = Eigen::Vector4d::Zero();
};

/// Uniform grid over the tetrahedra of a mesh. Holds copies of what it needs; queries are thread-safe.
class PointLocator {
public:
    explicit PointLocator(const TetMesh& mesh);

    /// The tetrahedron that contains a point (LPS mm), the lowest index among several; nothing when outside by more
    /// than `tolerance` in barycentric coordinates.
    [[nodiscard]] std::optional<Location> find(const Eigen::Vector3d& point, double tolerance = 1e-9) const;

private:
    /// The last three barycentric coordinates of x are inverse (x − corner).
    struct Cell {
        Eigen::Vector3d corner;
        Eigen::Matrix3d inverse;
    };
    std::vector<Cell> tets_;
    Eigen::Vector3d lower_, cell_;
    Eigen::Vector3d reach_;  ///< largest extent of a tetrahedron along each axis, mm
    std::array<int, 3> cells_{};
    std::vector<int> offset_, entry_;
};

/// Value of a nodal field (C × N) at a location.
Eigen::VectorXd interpolate(const TetMesh& mesh, const Eigen::MatrixXd& nodal, const Location& location);

}  // namespace tissuewarp::meshing
