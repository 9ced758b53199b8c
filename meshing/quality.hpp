#pragma once
/// How good a tetrahedral mesh is for explicit dynamics.

#include "meshing/tet_mesh.hpp"

#include <map>

namespace tissuewarp::meshing {

struct Distribution {
    double minimum = 0, percentile_1 = 0, median = 0, percentile_99 = 0, maximum = 0, mean = 0;
};

struct QualityReport {
    Distribution min_dihedral_deg;  ///< smallest dihedral angle per tetrahedron, degrees
    Distribution max_dihedral_deg;  ///< largest dihedral angle per tetrahedron, degrees
    Distribution radius_edge;       ///< circumradius over shortest edge; 0.612 for the regular tetrahedron
    Distribution volume_mm3;        ///< per tetrahedron
    Distribution edge_mm;           ///< over edges
    std::map<int, double> label_volume_mm3;
    int step_limiting_tet = -1;  ///< element with the largest Σ|∇N|², which bounds the critical time step
    double step_limit_mm = 0;    ///< its 1/√(Σ|∇N|²), mm: Δt ≤ 2 · step_limit / (2 c) in the element bound
    int components = 0;          ///< face-connected pieces
};

QualityReport quality(const TetMesh& mesh);

/// Smallest and largest dihedral angle of each tetrahedron, degrees, 2 × M.
Eigen::Matrix2Xd dihedral_angles(const TetMesh& mesh);

}  // namespace tissuewarp::meshing
