/// Fibre directions out of volumes and of tetrahedra.

#include "simulation/fibres.hpp"

#include "core/errors.hpp"
#include "meshing/primitives.hpp"
#include "tests/simulation/cube.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <limits>

namespace tissuewarp::simulation {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using ::testing::HasSubstr;

constexpr float nan = std::numeric_limits<float>::quiet_NaN();

/// On voxels of 2 mm, turned by 30° about z, that cover [−5, 15]³ mm and more.
FibreVolume volume_of(const std::function<Vector3d(const Vector3d&)>& direction) {
    imaging::Geometry grid;
    grid.size = {24, 24, 14};
    grid.spacing.setConstant(2.0);
    grid.direction << std::cos(0.5), -std::sin(0.5), 0, std::sin(0.5), std::cos(0.5), 0, 0, 0, 1;
    grid.origin = Vector3d(5, 5, 5) - grid.direction * Vector3d(23, 23, 13);
    imaging::Volume volume(grid, CV_32FC3);
    for (int k = 0; k < 14; ++k)
        for (int j = 0; j < 24; ++j)
            for (int i = 0; i < 24; ++i) {
                const Vector3d v = direction(grid.point({double(i), double(j), double(k)}));
                volume.data<cv::Vec3f>()[volume.offset(i, j, k)] = {float(v[0]), float(v[1]), float(v[2])};
            }
    return {volume};
}

/// [0, 10]³ mm, label 2 above half its height.
meshing::TetMesh two_labels() {
    meshing::TetMesh mesh = meshing::box_mesh({10, 10, 10}, {4, 4, 4});
    for (int e = 0; e < mesh.tet_count(); ++e)
        mesh.labels[e] = mesh.nodes(Eigen::all, mesh.tets.col(e)).row(2).mean() > 5 ? 2 : 1;
    return mesh;
}

Vector3d centroid(const meshing::TetMesh& mesh, int e) {
    return mesh.nodes(Eigen::all, mesh.tets.col(e)).rowwise().mean();
}

std::string refusal(const std::function<void()>& what) {
    try {
        what();
    } catch (const InvalidInput& error) {
        return error.what();
    }
    return "accepted";
}

// A failure looks like: components in the frame of the voxels, or directions of other places.
TEST(Fibres, AreThoseOfTheVolumeAtEachCentroidInLps) {
    const auto around = [](const Vector3d& x) { return Vector3d(-(x[1] + 30), x[0] + 40, 10).normalized(); };
    const meshing::TetMesh mesh = two_labels();
    const Matrix3Xd fibres = fibres_of(volume_of(around), mesh, 2);
    for (int e = 0; e < mesh.tet_count(); ++e) {
        if (mesh.labels[e] == 1) {
            EXPECT_TRUE(fibres.col(e).isZero(0.0));
        } else {
            EXPECT_LT((fibres.col(e) - around(centroid(mesh, e))).norm(), 1e-3);
        }
    }
}

// A fibre runs both ways: vectors that point to either side by chance would cancel.
TEST(Fibres, HaveNoSignAndNoLength) {
    const Vector3d axis = Vector3d(1, 2, -1).normalized();
    int voxel = 0;
    const auto either_way = [&](const Vector3d&) -> Vector3d {
        ++voxel;
        return (voxel * voxel % 7 < 3 ? -0.1 : 30.0) * axis;
    };
    const meshing::TetMesh mesh = two_labels();
    const Matrix3Xd fibres = fibres_of(volume_of(either_way), mesh, 1);
    for (int e = 0; e < mesh.tet_count(); ++e)
        if (mesh.labels[e] == 1) {
            EXPECT_NEAR(std::abs(fibres.col(e).dot(axis)), 1, 1e-6);
        }
}

TEST(Fibres, AreRefusedWithThePlaceWhereThereAreNone) {
    const meshing::TetMesh mesh = two_labels();
    const auto of = [&](const FibreVolume& volume, int label) {
        return refusal([&] { fibres_of(volume, mesh, label); });
    };
    const FibreVolume below = volume_of([](const Vector3d& x) { return Vector3d(x[2] < 6 ? 1 : 0, 0, 0); });
    EXPECT_EQ(of(below, 1), "accepted");
    EXPECT_THAT(of(below, 2), ::testing::AllOf(HasSubstr("label 2"), HasSubstr("zeros"), HasSubstr("mm")));
    EXPECT_THAT(of(volume_of([](const Vector3d&) { return Vector3d(nan, 0, 0); }), 1), HasSubstr("not finite"));
    FibreVolume elsewhere = volume_of([](const Vector3d&) { return Vector3d(1, 0, 0); });
    elsewhere.directions.geometry.origin.x() += 60;
    EXPECT_THAT(of(elsewhere, 1), HasSubstr("no voxel"));
    EXPECT_THAT(of({imaging::Volume(elsewhere.directions.geometry, CV_32FC1)}, 1), HasSubstr("three components"));
    FibresOfTetrahedra given{Vector3d::UnitX().replicate(1, mesh.tet_count())};
    given.directions.col(0).setZero();
    ASSERT_EQ(mesh.labels[0], 1);
    EXPECT_THAT(refusal([&] { fibres_of(given, mesh, 1); }), HasSubstr("zeros"));
    EXPECT_EQ(refusal([&] { fibres_of(given, mesh, 2); }), "accepted") << "of another label";
    given.directions.conservativeResize(3, 7);
    EXPECT_THAT(refusal([&] { fibres_of(given, mesh, 2); }), HasSubstr("7 directions"));
}

Scene fibrous() {
    Scene scene = test::cube();
    scene.tissues[1].material = tled::TransverselyIsotropic{1.0, 20.0, 5.0, Vector3d::UnitX()};
    return scene;
}

TEST(Fibres, ReachTheModelAndStayWithTheirTissueWhenSomeIsTakenOut) {
    Scene scene = fibrous();
    EXPECT_EQ(build(scene).stages[0].model.fibre.size(), 0) << "one direction for all is the material's";
    const meshing::TetMesh mesh = meshing::box_mesh({100, 100, 100}, {4, 4, 4});
    Matrix3Xd directions(3, mesh.tet_count());
    for (int e = 0; e < mesh.tet_count(); ++e) directions.col(e) = 3 * centroid(mesh, e);
    scene.tissues[1].fibres = FibresOfTetrahedra{directions};
    scene.sets["corner"].ball = Ball{{100, 100, 100}, 60};
    scene.resections.push_back({"corner", 0.5});
    const BuiltScene built = build(scene);
    ASSERT_EQ(built.stages.size(), 2u);
    EXPECT_LT(built.stages[1].tet.size(), built.stages[0].tet.size());
    for (const Stage& stage : built.stages)
        for (std::size_t e = 0; e < stage.tet.size(); ++e)
            EXPECT_LT((stage.model.fibre.col(static_cast<Eigen::Index>(e)) - centroid(mesh, stage.tet[e]).normalized())
                          .norm(),
                      1e-12);
    scene.tissues[1].material = tled::neo_hookean_iso(3, 0.3);
    EXPECT_THAT(refusal([&] { require_valid(scene); }), HasSubstr("transversely-isotropic"));
}

}  // namespace
}  // namespace tissuewarp::simulation
