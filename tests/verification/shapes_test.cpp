// Structured meshes of the verification problems.

#include "tests/verification/shapes.hpp"

#include <gtest/gtest.h>

namespace tissuewarp::verification {
namespace {

// Six tetrahedra become one hexahedron of the same volume, with corners in the order that its element needs, on both
// sides of the planes where the diagonals are mirrored.
TEST(HexahedraOf, HaveTheCellsOfTheMesh) {
    meshing::TetMesh mesh = symmetric_box({{{-1.0, -0.25, 0.0, 0.5}, {0.0, 0.5, 1.5}, {-2.0, 0.0, 1.0}}});
    for (int e = 0; e < mesh.tet_count(); ++e) mesh.labels[e] = 1 + e / 6 % 2;
    const meshing::HexCells cells = hexahedra_of(mesh);
    ASSERT_EQ(cells.count(), 12);
    EXPECT_NO_THROW(meshing::require_valid(mesh.nodes, cells, "cells"));
    const Eigen::VectorXd volume = meshing::hex_volumes(mesh.nodes, cells), tets = meshing::tet_volumes(mesh);
    for (int e = 0; e < cells.count(); ++e) {
        EXPECT_NEAR(volume[e], tets.segment(6 * e, 6).sum(), 1e-14) << e;
        EXPECT_EQ(cells.labels[e], mesh.labels[6 * e]) << e;
    }
    EXPECT_NEAR(meshing::scaled_jacobians(mesh.nodes, cells).minCoeff(), 1.0, 1e-14);  // bricks
}

}  // namespace
}  // namespace tissuewarp::verification
