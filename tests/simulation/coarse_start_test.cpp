/// Equilibria of fine meshes that begin with those of coarser ones.

#include "simulation/coarse_start.hpp"

#include "meshing/primitives.hpp"
#include "simulation/run.hpp"
#include "tests/simulation/cube.hpp"
#include "tests/support/noted.hpp"

#include <gtest/gtest.h>

namespace tissuewarp::simulation {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

/// 192 mm long, held at one end, hangs by most of its length.
Scene rod(int cells_across) {
    Scene scene;
    scene.geometry = BoxGeometry{Vector3d::Zero(), {192, 24, 24}, {8 * cells_across, cells_across, cells_across}};
    scene.tissues[1].material = tled::neo_hookean_lnj(12.0, 0.4);
    scene.sets["end"].side = Side{0, false, 0.0};
    scene.fixed.push_back({"end", {true, true, true}});
    scene.gravity = Gravity{std::nullopt, {0, 0, -1}, 9810.0, {}};
    scene.solve.device = Device::Cpu;
    return scene;
}

TEST(CoarserScene, HasTwiceTheEdgeWhereItIsTheSameScene) {
    const Scene fine = rod(6);
    const auto coarse = coarser(fine, 10368);
    ASSERT_TRUE(coarse);
    EXPECT_EQ(std::get<BoxGeometry>(coarse->geometry).cells, (std::array<int, 3>{24, 3, 3}));
    EXPECT_FALSE(coarser(fine, 9999)) << "small";
    Scene shapes = fine;
    shapes.geometry = ShapeGeometry{{{1, Ellipsoid{Vector3d::Zero(), {9, 9, 9}}}}, 2.5, {{1, 1.5}}};
    const auto coarse_shapes = coarser(shapes, 20000);
    ASSERT_TRUE(coarse_shapes);
    EXPECT_EQ(std::get<ShapeGeometry>(coarse_shapes->geometry).edge_length, 5.0);
    EXPECT_EQ(std::get<ShapeGeometry>(coarse_shapes->geometry).label_edge_length.at(1), 3.0);
    Scene meshed = fine, sliding = fine;
    meshed.geometry = meshing::box_mesh({1, 1, 1}, {2, 2, 2});
    EXPECT_FALSE(coarser(meshed, 20000));
    sliding.sliding.push_back({{1, 2}, 100.0, {}});
    EXPECT_FALSE(coarser(sliding, 20000));
}

TEST(CarriedOn, IsLinearAndGoesOnBeyondTheSurface) {
    const meshing::TetMesh mesh = meshing::box_mesh({10, 10, 10}, {2, 2, 2});
    Eigen::Matrix3d gradient;
    gradient << 0.1, 0.2, 0, -0.3, 0.4, 0.1, 0, 0, 0.2;
    Matrix3Xd places(3, 3);
    places << 1, 5, 10.4, 2, 5, 3, 3, 5, 4;
    const auto carried = carried_on(mesh, gradient * mesh.nodes, places);
    ASSERT_TRUE(carried);
    EXPECT_LT((*carried - gradient * places).cwiseAbs().maxCoeff(), 1e-12);
    places.col(0) << 40, 5, 5;
    EXPECT_FALSE(carried_on(mesh, gradient * mesh.nodes, places));
}

TEST(CoarseStart, LiesNearTheEquilibriumAndSavesThePathToIt) {
    const BuiltScene built = build(rod(6));
    const auto start = coarse_start(built, 1.0, silent_observer());
    ASSERT_TRUE(start);
    Matrix3Xd u;
    tissuewarp::test::Noted observer;
    const RunSummary summary = simulate(
        built, [&](const Frame& frame) { u = frame.displacement; }, observer);
    EXPECT_GT(u.colwise().norm().maxCoeff(), 90);
    EXPECT_EQ(start->method, tled::EquilibriumMethod::Newton);
    EXPECT_LT((start->displacement - u).colwise().norm().maxCoeff(), 15);
    EXPECT_LE(summary.steps, 20) << "force evaluations on the fine mesh; a path takes more than fifty";
    EXPECT_LE(summary.estimated_error_mm, built.scene.solve.tolerance_mm);
    Scene path = built.scene;
    path.solve.method = tled::EquilibriumMethod::Newton;
    path.solve.precision = tled::Scalar::Float64;
    path.solve.load_steps = 3;
    Matrix3Xd along;
    simulate(build(path), [&](const Frame& frame) { along = frame.displacement; });
    EXPECT_LT((u - along).colwise().norm().maxCoeff(), 2 * built.scene.solve.tolerance_mm);
}

}  // namespace
}  // namespace tissuewarp::simulation
