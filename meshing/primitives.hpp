#pragma once
/// Meshes of simple shapes, for tests, studies and benchmarks.

#include "meshing/tet_mesh.hpp"

#include <array>
#include <cstdint>
#include <vector>

namespace tissuewarp::meshing {

/// The box [0, size] (mm) cut into cells of six Kuhn tetrahedra each, conforming and positively oriented, label 1.
/// Node (i, j, k) has index i + (nx + 1) (j + (ny + 1) k); cell (i, j, k) owns the tetrahedra 6 c … 6 c + 5 with
/// c = i + nx (j + ny k). `jitter` moves interior nodes by up to that fraction of the cell edge along each axis, drawn
/// from a generator that depends on `seed` alone; boundary nodes stay. Throws InvalidInput unless size and cells are
/// positive, and where jitter inverts a tetrahedron; below 1/6 it cannot (the edge matrix stays diagonally dominant).
TetMesh box_mesh(const Eigen::Vector3d& size, const std::array<int, 3>& cells, double jitter = 0.0,
                 std::uint32_t seed = 1);

/// The same cells between planes at the given coordinates (mm, at least two an axis, ascending), for meshes graded
/// towards a face or cut at an inner one. Throws InvalidInput otherwise.
TetMesh box_mesh(const std::array<std::vector<double>, 3>& coordinates);

}  // namespace tissuewarp::meshing
