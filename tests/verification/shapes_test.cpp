// Structured meshes of the verification problems.

#include "tests/verification/shapes.hpp"

#include <gtest/gtest.h>

namespace tissuewarp::verification {
namespace {

// On both sides of the planes where the diagonals are mirrored.
TEST(SymmetricBox, FillsEveryCellWithSixTetrahedra) {
    const meshing::TetMesh mesh = symmetric_box({{{-1.0, -0.25, 0.0, 0.5}, {0.0, 0.5, 1.5}, {-2.0, 0.0, 1.0}}});
    ASSERT_EQ(mesh.tet_count(), 72);
    EXPECT_NO_THROW(meshing::require_valid(mesh, "box"));
    const Eigen::VectorXd volumes = meshing::tet_volumes(mesh);
    constexpr double x[] = {0.75, 0.25, 0.5}, y[] = {0.5, 1.0}, z[] = {2.0, 1.0};
    for (int cell = 0; cell < 12; ++cell) {
        const double whole = x[cell % 3] * y[cell / 3 % 2] * z[cell / 6];
        EXPECT_NEAR(volumes.segment(6 * cell, 6).sum(), whole, 1e-14) << cell;
    }
}

}  // namespace
}  // namespace tissuewarp::verification
