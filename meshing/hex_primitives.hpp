#pragma once
/// Boxes of hexahedra, alone or beside tetrahedra, for tests, studies and benchmarks.

#include "meshing/hex_cells.hpp"

#include <array>
#include <cstdint>
#include <functional>

namespace tissuewarp::meshing {

/// The box [0, size] (mm) of one hexahedron per cell, label 1; nodes and jitter are those of box_mesh, and so are the
/// errors. Cell (i, j, k) has index i + nx (j + ny k).
MixedMesh box_hexes(const Eigen::Vector3d& size, const std::array<int, 3>& cells, double jitter = 0.0,
                    std::uint32_t seed = 1);

/// The same box with a hexahedron where `is_hexahedron(i, j, k)` and six Kuhn tetrahedra elsewhere, both in the order
/// of the cells.
MixedMesh mixed_box(const Eigen::Vector3d& size, const std::array<int, 3>& cells,
                    const std::function<bool(int, int, int)>& is_hexahedron, double jitter = 0.0,
                    std::uint32_t seed = 1);

}  // namespace tissuewarp::meshing
