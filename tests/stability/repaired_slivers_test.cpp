// The slivers of the suite after the mesher's relaxation. It needs the mesher, so CGAL; the rest of the suite does not.

#include "meshing/detail/relaxation.hpp"
#include "meshing/quality.hpp"
#include "tests/stability/hard_cases.hpp"
#include "tled/critical_step.hpp"

namespace tissuewarp::stability {
namespace {

using RepairedSlivers = OnEveryEngine;
INSTANTIATE_TEST_SUITE_P(All, RepairedSlivers, every_engine, engine_name);

/// A label map of the cube of 40 mm: voxels of 1 mm, three of background around it.
meshing::detail::LabelGrid cube_labels() {
    meshing::detail::LabelGrid grid{{46, 46, 46}, {0, 0, 0}, Eigen::Array3d::Ones(), {0, 1}, {}};
    grid.classes.assign(46 * 46 * 46, 0);
    for (int k = 3; k < 43; ++k)
        for (int j = 3; j < 43; ++j)
            for (int i = 3; i < 43; ++i) grid.classes[grid.offset(i, j, k)] = 1;
    return grid;
}

/// The mesh with slivers as the mesher would leave it: nodes moved, connectivity kept.
tled::Model repaired_slivers() {
    tled::Model model = with_slivers();
    const meshing::detail::LabelField field(cube_labels(), 0.0);
    const std::vector<double> edge_length{0, 10};
    const Vector3d corner = Vector3d::Constant(2.5);  // the cube's among the labels, whose voxel centres are at 0, 1, …
    model.mesh.nodes.colwise() += corner;
    meshing::detail::relax(model.mesh, {field, edge_length, 1.0, 1.0, 12.0});
    model.mesh.nodes.colwise() -= corner;
    return model;
}

tled::Model ordinary_cube() {
    return box({40, 40, 40}, {4, 4, 4}, tled::neo_hookean_lnj(3.0, 0.45));
}

double critical_step(Kind kind, const tled::Model& model) {
    const tled::RestState rest = tled::rest_state(model);
    const auto engine = make_engine(kind, rest);
    const Matrix3Xd mass = tled::scene::lumped(rest);
    return 2 / std::sqrt(tled::highest_mode(*engine, mass, Matrix3Xd::Zero(3, rest.node_count), 60).eigenvalue);
}

// A failure looks like: slivers that stay, or a step that is still theirs.
TEST_P(RepairedSlivers, GiveTheStepOfTheOrdinaryMeshBack) {
    const tled::Model broken = with_slivers(), repaired = repaired_slivers();
    ASSERT_LT(meshing::dihedral_angles(broken.mesh).row(0).minCoeff(), 0.6);
    EXPECT_GT(meshing::dihedral_angles(repaired.mesh).row(0).minCoeff(), 10);
    const double ordinary = critical_step(GetParam(), ordinary_cube());
    EXPECT_LT(critical_step(GetParam(), broken), 0.3 * ordinary);
    EXPECT_GT(critical_step(GetParam(), repaired), 0.7 * ordinary);
}

// Before and after, the answer is Newton's on the mesh itself, and the ordinary cube's at the nodes that lie where its
// nodes do. A failure looks like: a bump around the slivers, or a repair that moved the surface and so the answer.
// Tolerance 0.05 mm of 6 mm.
TEST_P(RepairedSlivers, MoveAsTheOrdinaryMeshDoesBeforeAndAfter) {
    const tled::Model ordinary = ordinary_cube();
    const tled::NodalConditions conditions = between_plates(ordinary, {3, 0, 5});
    const Matrix3Xd truth = by_newton(tled::rest_state(ordinary), conditions, 4);
    for (const tled::Model& model : {with_slivers(), repaired_slivers()}) {
        const tled::RestState rest = tled::rest_state(model);
        const Matrix3Xd u = solved_in_parts(GetParam(), rest, conditions, 0.02);
        EXPECT_LT(distance(u, by_newton(rest, conditions, 4)), 0.05);
        int elsewhere = 0;
        for (int node = 0; node < rest.node_count; ++node) {
            if ((model.mesh.nodes.col(node) - ordinary.mesh.nodes.col(node)).norm() > 0.01)
                ++elsewhere;
            else
                EXPECT_LT((u.col(node) - truth.col(node)).norm(), 0.05) << "node " << node;
        }
        EXPECT_LE(elsewhere, 4);
    }
}

}  // namespace
}  // namespace tissuewarp::stability
