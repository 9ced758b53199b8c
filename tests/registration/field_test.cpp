#include "registration/field.hpp"

#include "core/errors.hpp"
#include "imaging/image_io.hpp"
#include "meshing/point_location.hpp"
#include "registration/evaluation.hpp"
#include "registration/field/inverse_transform.hpp"
#include "shapes.hpp"
#include "tests/support/folders.hpp"
#include "tests/support/noted.hpp"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cstring>

namespace tissuewarp::registration {
namespace {

using imaging::Geometry;
using imaging::Volume;
using test::for_each_voxel;
using test::vector_at;

const Eigen::Matrix3d affine = (Eigen::Matrix3d() << 0.05, 0.02, -0.03, 0.01, -0.04, 0.02, 0.03, 0.01, 0.06).finished();

Eigen::Vector3d affine_displacement(const Eigen::Vector3d& X) {
    return affine * X + Eigen::Vector3d(1.0, -2.0, 0.5);
}

/// An outward or inward bump of the surface of a ball of radius 40 mm around the origin.
Eigen::Vector3d bump(const Eigen::Vector3d& X, double height) {
    const double r = (X - Eigen::Vector3d(40.0, 0.0, 0.0)).norm();
    return r < 25.0 ? Eigen::Vector3d(0.5 * height * (1.0 + std::cos(EIGEN_PI * r / 25.0)), 0.0, 0.0)
                    : Eigen::Vector3d::Zero();
}

bool same_bits(const Volume& a, const Volume& b) {
    return a.voxels.total() == b.voxels.total() &&
           std::memcmp(a.voxels.data, b.voxels.data, a.voxels.total() * a.voxels.elemSize()) == 0;
}

TEST(ForwardField, ReproducesAnAffineDisplacementAtEveryVoxelInside) {
    const Deformation deformation =
        test::deformed_by(test::box_at({-20, -15, -10}, {40, 30, 20}, {8, 6, 4}, 0.15), affine_displacement);
    const Geometry grid = test::oblique_grid({0.3, -0.2, 0.1}, {41, 37, 29}, {1.1, 0.9, 1.4});
    const Volume field = displacement_moving_to_fixed(deformation, grid);
    int inside = 0;
    for_each_voxel(field, [&](const Eigen::Vector3d& index, std::int64_t n) {
        const Eigen::Vector3d X = grid.point(index);
        if ((X.cwiseAbs() - Eigen::Vector3d(20, 15, 10)).maxCoeff() > 0.0) return;
        ++inside;
        ASSERT_LT((vector_at(field, n) - affine_displacement(X)).norm(), 1e-5) << X.transpose();
    });
    EXPECT_NEAR(inside * grid.voxel_volume(), 40.0 * 30.0 * 20.0, 0.02 * 24000.0);
}

// A layer too many or too few, or values taken from outside, would show beyond the reach or at its edge.
TEST(FieldNearTheMesh, IsTheForwardFieldInsideContinuedAsFarAsAsked) {
    Deformation deformation =
        test::deformed_by(test::box_at({-20, -15, -10}, {40, 30, 20}, {8, 6, 4}, 0.15), affine_displacement);
    deformation.placement = test::motion(12.0, {0.2, 1.0, 0.4}, {5.0, -3.0, 8.0});
    const Geometry grid = test::oblique_grid({0.3, -0.2, 0.1}, {61, 57, 49}, {1.1, 0.9, 1.4});
    constexpr int reach = 3;
    const Volume near = displacement_near_mesh(deformation, grid, reach);
    const Volume whole = displacement_moving_to_fixed(deformation, grid);
    int inside = 0, beside = 0, beyond = 0;
    for_each_voxel(near, [&](const Eigen::Vector3d& index, std::int64_t n) {
        const Eigen::Vector3d X = grid.point(index);
        const double outside = (X.cwiseAbs() - Eigen::Vector3d(20, 15, 10)).maxCoeff();  // mm, of the farthest axis
        const Eigen::Vector3d rigid = deformation.placement * X - X;
        if (outside < 0) {
            ++inside;
            ASSERT_LT((vector_at(near, n) - vector_at(whole, n)).norm(), 1e-5) << X.transpose();
        } else if (outside > 1e-6 && outside < 0.9) {  // one step away at most where no edge is near
            const Eigen::Vector3d expected = deformation.placement * (X + affine_displacement(X)) - X;
            if ((X.cwiseAbs() - Eigen::Vector3d(20, 15, 10)).cwiseMax(0.0).norm() > outside + 1e-9) return;
            ++beside;
            ASSERT_LT((vector_at(near, n) - expected).norm(), 1.0) << X.transpose();
        } else if (outside > 1.4 * std::sqrt(3.0) * (reach + 1)) {
            ++beyond;
            ASSERT_LT((vector_at(near, n) - rigid).norm(), 1e-4) << X.transpose();
        }
    });
    EXPECT_GT(inside, 10000);
    EXPECT_GT(beside, 1000);
    EXPECT_GT(beyond, 10000);
}

// Layers grow in parallel by slices. A front that lost or doubled a voxel at the border of two slices, or that read
// what its own layer had just written, would show in the last digits here.
TEST(FieldNearTheMesh, GrowsByTheMeansOfWhatLiesBeside) {
    const Deformation deformation =
        test::deformed_by(test::box_at({-20, -15, -10}, {40, 30, 20}, {8, 6, 4}, 0.15), affine_displacement);
    const Geometry grid = test::plain_grid({45, 39, 23}, 1.0, {-24, -17, -9});  // cuts the box along two axes
    constexpr int reach = 5;
    Volume expected = displacement_near_mesh(deformation, grid, 0);
    const std::array<std::int64_t, 3> stride{1, grid.size[0], std::int64_t{grid.size[0]} * grid.size[1]};
    for (int layer = 0; layer < reach; ++layer) {
        const Volume before = expected.clone();
        for_each_voxel(before, [&](const Eigen::Vector3d& index, std::int64_t n) {
            const auto* values = before.data<cv::Vec3f>();
            if (values[n] != cv::Vec3f(0, 0, 0)) return;
            cv::Vec3f sum(0, 0, 0);
            int count = 0;
            for (int axis = 0; axis < 3; ++axis)
                for (const int side : {-1, 1}) {
                    const double place = index[axis] + side;
                    if (place < 0 || place > grid.size[static_cast<std::size_t>(axis)] - 1) continue;
                    const cv::Vec3f& beside = values[n + side * stride[static_cast<std::size_t>(axis)]];
                    sum += beside;
                    count += beside != cv::Vec3f(0, 0, 0);
                }
            if (count > 0) expected.data<cv::Vec3f>()[n] = sum / float(count);
        });
    }
    EXPECT_TRUE(same_bits(displacement_near_mesh(deformation, grid, reach), expected));
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    EXPECT_TRUE(same_bits(displacement_near_mesh(deformation, grid, reach), expected));
}

TEST(BackwardField, IsTheExactInverseOfAnAffineMap) {
    Deformation deformation =
        test::deformed_by(test::box_at({-20, -15, -10}, {40, 30, 20}, {8, 6, 4}, 0.15), affine_displacement);
    deformation.placement = test::motion(12.0, {0.2, 1.0, 0.4}, {5.0, -3.0, 8.0});
    const Geometry grid = test::oblique_grid({6.0, -5.0, 8.0}, {47, 43, 31}, {1.1, 0.9, 1.4});
    const Volume field = displacement_fixed_to_moving(deformation, grid);
    const Eigen::Matrix3d inverse = (Eigen::Matrix3d::Identity() + affine).inverse();
    int inside = 0;
    for_each_voxel(field, [&](const Eigen::Vector3d& index, std::int64_t n) {
        const Eigen::Vector3d y = grid.point(index);
        const Eigen::Vector3d X = inverse * (deformation.placement.inverse() * y - affine_displacement({0, 0, 0}));
        if ((X.cwiseAbs() - Eigen::Vector3d(20, 15, 10)).maxCoeff() > 0.0) return;
        ++inside;
        ASSERT_LT((vector_at(field, n) - (X - y)).norm(), 1e-5) << y.transpose();
    });
    EXPECT_GT(inside, 15000);
}

TEST(BackwardField, ComposedWithTheForwardMapIsTheIdentityInside) {
    const Deformation deformation =
        test::deformed_by(test::ball({0, 0, 0}, 40.0, 12), [](const auto& X) { return bump(X, -9.0); });
    const Geometry grid = test::oblique_grid({0, 0, 0}, {61, 51, 45}, {1.9, 2.1, 2.3});
    const Volume field = displacement_fixed_to_moving(deformation, grid);
    const meshing::PointLocator deformed(deformation.deformed_mesh());
    const PointTransform forward(deformation);
    int inside = 0;
    for_each_voxel(field, [&](const Eigen::Vector3d& index, std::int64_t n) {
        const Eigen::Vector3d y = grid.point(index);
        if (!deformed.find(y)) return;
        ++inside;
        ASSERT_LT((forward(y + vector_at(field, n)).col(0) - y).norm(), 1e-4) << y.transpose();
    });
    EXPECT_GT(inside, 20000);
}

TEST(BackwardField, IsNearlyInverseOutsideTheMesh) {
    for (const double height : {-9.0, 7.0}) {
        const Deformation deformation =
            test::deformed_by(test::ball({0, 0, 0}, 40.0, 14), [&](const auto& X) { return bump(X, height); });
        const Geometry grid = test::plain_grid({60, 60, 60}, 2.0, {-59, -59, -59});
        const Volume field = displacement_fixed_to_moving(deformation, grid);
        const PointTransform forward(deformation);
        std::vector<double> error;
        for_each_voxel(field, [&](const Eigen::Vector3d& index, std::int64_t n) {
            const Eigen::Vector3d y = grid.point(index);
            error.push_back((forward(y + vector_at(field, n)).col(0) - y).norm());
        });
        const Summary summary = summarise(error);
        EXPECT_LT(summary.percentile_95, 1e-3) << height;
        EXPECT_LT(summary.maximum, 0.02) << height;
    }
}

// So steep a bump that from rest the steps lead nowhere in places: these rows start from the continued inverse, made
// once, by whichever thread comes first.
TEST(BackwardField, IsNearlyInverseBesideASteepBump) {
    const Deformation deformation =
        test::deformed_by(test::ball({0, 0, 0}, 40.0, 14), [](const auto& X) { return bump(X, -18.0); });
    const Geometry grid = test::plain_grid({60, 60, 60}, 2.0, {-59, -59, -59});
    const Volume field = displacement_fixed_to_moving(deformation, grid);
    const PointTransform forward(deformation);
    std::vector<double> error;
    for_each_voxel(field, [&](const Eigen::Vector3d& index, std::int64_t n) {
        const Eigen::Vector3d y = grid.point(index);
        error.push_back((forward(y + vector_at(field, n)).col(0) - y).norm());
    });
    const Summary summary = summarise(error);
    EXPECT_LT(summary.percentile_95, 1e-3);
    EXPECT_LT(summary.maximum, 0.02);
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    EXPECT_TRUE(same_bits(displacement_fixed_to_moving(deformation, grid), field));
}

TEST(Rasterisation, LeavesNoHole) {
    // The grid passes through nodes, edges and faces of the mesh, where rounding could lose a voxel between elements. A
    // hole would take the continuation, which is zero here only by chance: the field inside is far from harmonic.
    const meshing::TetMesh mesh = test::box_at({4, 4, 4}, {24, 24, 24}, {8, 8, 8}, 0.12);
    const auto rough = [](const Eigen::Vector3d& X) {
        return Eigen::Vector3d(std::sin(9.0 * X[0]), std::sin(7.0 * X[1] + X[2]), std::cos(8.0 * X[2]));
    };
    const Deformation deformation = test::deformed_by(mesh, rough);
    const meshing::PointLocator locator(mesh);
    const Geometry grid = test::plain_grid({33, 33, 33});
    const Volume field = displacement_moving_to_fixed(deformation, grid);
    int inside = 0;
    for_each_voxel(field, [&](const Eigen::Vector3d& index, std::int64_t n) {
        const auto location = locator.find(grid.point(index));
        if (!location) return;
        ++inside;
        const Eigen::Vector3d u = meshing::interpolate(mesh, deformation.displacement, *location);
        ASSERT_LT((vector_at(field, n) - u).norm(), 1e-5) << index.transpose();
    });
    EXPECT_EQ(inside, 25 * 25 * 25);
}

TEST(Field, DoesNotDependOnTheNumberOfThreads) {
    Deformation deformation =
        test::deformed_by(test::ball({0, 0, 0}, 40.0, 10), [](const auto& X) { return bump(X, -9.0); });
    deformation.placement = test::motion(5.0, {0, 0, 1}, {1, 2, 3});
    const Geometry grid = test::oblique_grid({0, 0, 0}, {41, 39, 35}, {2.5, 2.5, 2.5});
    Volume forward[2], backward[2];
    for (const int threads : {1, 2}) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                        static_cast<std::size_t>(threads));
        forward[threads - 1] = displacement_moving_to_fixed(deformation, grid);
        backward[threads - 1] = displacement_fixed_to_moving(deformation, grid);
    }
    EXPECT_TRUE(same_bits(forward[0], forward[1]));
    EXPECT_TRUE(same_bits(backward[0], backward[1]));
}

TEST(Field, OfNoDeformationIsExactlyZero) {
    const Deformation deformation =
        test::deformed_by(test::box_at({3, 3, 3}, {20, 20, 20}, {3, 3, 3}),
                          [](const auto&) -> Eigen::Vector3d { return Eigen::Vector3d::Zero(); });
    const Geometry grid = test::oblique_grid({13, 13, 13}, {31, 27, 25}, {1.3, 1.7, 2.9});
    for (const Volume& field :
         {displacement_moving_to_fixed(deformation, grid), displacement_fixed_to_moving(deformation, grid)})
        EXPECT_EQ(cv::norm(field.voxels, cv::NORM_INF), 0.0);
}

TEST(Field, OfAPlacementIsRigidEverywhere) {
    Deformation deformation = test::deformed_by(test::box_at({3, 3, 3}, {20, 20, 20}, {3, 3, 3}),
                                                [](const auto&) -> Eigen::Vector3d { return Eigen::Vector3d::Zero(); });
    deformation.placement = test::motion(20.0, {1, 1, 0}, {4, -6, 3});
    const Geometry grid = test::oblique_grid({13, 13, 13}, {61, 57, 45}, {3.1, 3.3, 2.9});  // well beyond the fade
    const Volume forward = displacement_moving_to_fixed(deformation, grid);
    const Volume backward = displacement_fixed_to_moving(deformation, grid);
    for_each_voxel(forward, [&](const Eigen::Vector3d& index, std::int64_t n) {
        const Eigen::Vector3d p = grid.point(index);
        ASSERT_LT((p + vector_at(forward, n) - deformation.placement * p).norm(), 2e-5);
        ASSERT_LT((p + vector_at(backward, n) - deformation.placement.inverse() * p).norm(), 2e-5);
    });
}

TEST(Continuation, IsHarmonicWhereItIsGentleAndZeroBeyondTheFadeDistance) {
    const Deformation deformation =
        test::deformed_by(test::ball({0, 0, 0}, 20.0, 12), [](const auto&) -> Eigen::Vector3d {
            return {0.5, 0, 0};
        });
    const PointTransform transform(deformation, {.fade_mm = 30.0});
    const auto displacement = [&](double x) { return transform(Eigen::Vector3d(x, 0, 0)).col(0)[0] - x; };
    EXPECT_NEAR(displacement(20.001), 0.5, 1e-3);
    EXPECT_EQ(displacement(56.0), 0.0);
    // Between concentric spheres of radii a = 20 and b = 50 the harmonic function from 1 to 0 is (a/r) (b − r) / (b −
    // a).
    for (const double r : {25.0, 30.0, 40.0}) EXPECT_NEAR(displacement(r), 0.5 * 20.0 / r * (50.0 - r) / 30.0, 0.015);
}

TEST(Continuation, MeetsTheMeshWithoutAJump) {
    for (const double height : {-9.0, 9.0}) {
        const meshing::TetMesh mesh = test::ball({0, 0, 0}, 40.0, 12);
        const PointTransform transform(test::deformed_by(mesh, [&](const auto& X) { return bump(X, height); }));
        const auto boundary = meshing::boundary_surface(mesh).surface;
        double jump = 0.0;
        for (const auto& triangle : boundary.triangles.colwise()) {
            const Eigen::Matrix3d corner = boundary.nodes(Eigen::all, triangle);
            const Eigen::Vector3d normal =
                (corner.col(1) - corner.col(0)).cross(corner.col(2) - corner.col(0)).normalized();
            const Eigen::Vector3d centre = corner.rowwise().mean();
            const Eigen::Vector3d in = centre - 1e-4 * normal, out = centre + 1e-4 * normal;
            jump = std::max(jump, (transform(out).col(0) - out - transform(in).col(0) + in).norm());
        }
        EXPECT_LT(jump, 2e-3) << height;  // 2e-4 mm apart, gradients below 1
    }
}

TEST(Continuation, DoesNotFoldBesideAMovingSurface) {
    for (const double height : {-9.0, 9.0}) {
        const Deformation deformation =
            test::deformed_by(test::ball({0, 0, 0}, 40.0, 16), [&](const auto& X) { return bump(X, height); });
        ASSERT_GT(mesh_jacobians(deformation).minimum, 0.2);
        const Geometry grid = test::plain_grid({100, 80, 80}, 1.5, {-65, -60, -60});
        const JacobianReport forward = field_jacobians(displacement_moving_to_fixed(deformation, grid));
        const JacobianReport backward = field_jacobians(displacement_fixed_to_moving(deformation, grid));
        EXPECT_GT(forward.minimum, 0.3) << height;
        EXPECT_GT(backward.minimum, 0.3) << height;
    }
}

TEST(Continuation, DoesNotFoldBesideABentOrgan) {
    const Deformation deformation =
        test::deformed_by(test::box_at({-80, -50, -30}, {160, 100, 60}, {16, 10, 6}),
                          [](const Eigen::Vector3d& X) { return Eigen::Vector3d(0, 0, 15.0 * X[0] * X[0] / 6400.0); });
    const Geometry grid = test::plain_grid({130, 90, 80}, 2.0, {-130, -90, -80});
    const JacobianReport forward = field_jacobians(displacement_moving_to_fixed(deformation, grid));
    EXPECT_GT(forward.minimum, 0.3);
    EXPECT_GT(field_jacobians(displacement_fixed_to_moving(deformation, grid)).minimum, 0.3);
}

TEST(Continuation, HoldsTheSurfaceOfASheetThinnerThanItsGrid) {
    const meshing::TetMesh sheet = test::box_at({0, 0, 0.6}, {40, 40, 0.8}, {10, 10, 1});
    const PointTransform transform(test::deformed_by(sheet, [](const auto&) { return Eigen::Vector3d(0, 0, 4); }));
    EXPECT_NEAR((transform(Eigen::Vector3d(20, 20, 1.401)).col(0)[2]), 5.401, 1e-3);
    EXPECT_NEAR((transform(Eigen::Vector3d(20, 20, 8.0)).col(0)[2]), 11.5, 0.5);  // still most of it 7 mm away
}

/// Two blocks, `gap` mm apart along x, the second moved by `second`.
Deformation blocks_across_a_gap(double gap, double lower, const Eigen::Vector3d& second) {
    const meshing::TetMesh a = test::box_at({lower - 12, 0, 0}, {12, 24, 24}, {3, 6, 6});
    const meshing::TetMesh b = test::box_at({lower + gap, 0, 0}, {12, 24, 24}, {3, 6, 6});
    return test::deformed_by(test::beside(a, b), [&](const Eigen::Vector3d& X) -> Eigen::Vector3d {
        return X[0] > lower + 0.5 * gap ? second : Eigen::Vector3d::Zero();
    });
}

TEST(Continuation, DoesNotJumpHalfwayAcrossANarrowGap) {
    constexpr double gap = 3.0, step = 0.05;
    const Eigen::Vector3d second(-1.2, 0.8, 0);        // nearer and beside
    for (const double lower : {0.0, 0.6, 1.2, 1.8}) {  // wherever the grid lies
        const PointTransform transform(blocks_across_a_gap(gap, lower, second));
        const auto displacement = [&](double s) {
            const Eigen::Vector3d X(lower + s, 11.3, 12.7);
            return Eigen::Vector3d(transform(X).col(0) - X);
        };
        double steepest = 0;
        for (double s = step; s < gap - step; s += step)
            steepest = std::max(steepest, (displacement(s + step) - displacement(s)).norm() / step);
        EXPECT_LT(steepest, 2.5 * second.norm() / gap) << lower;
        EXPECT_LT((displacement(1e-3)).norm(), 5e-3) << lower;
        EXPECT_LT((displacement(gap - 1e-3) - second).norm(), 5e-3) << lower;
    }
}

TEST(PointTransform, AgreesWithTheFieldInsideAndOutside) {
    Deformation deformation =
        test::deformed_by(test::ball({0, 0, 0}, 40.0, 10), [](const auto& X) { return bump(X, -9.0); });
    deformation.placement = test::motion(-7.0, {0.5, 0, 1}, {2, 2, -3});
    const Geometry grid = test::oblique_grid({10, 0, 0}, {41, 39, 35}, {2.9, 2.7, 3.1});
    const Volume field = displacement_moving_to_fixed(deformation, grid);
    const PointTransform transform(deformation);
    for_each_voxel(field, [&](const Eigen::Vector3d& index, std::int64_t n) {
        const Eigen::Vector3d X = grid.point(index);
        ASSERT_LT((transform(X).col(0) - X - vector_at(field, n)).norm(), 2e-5) << X.transpose();
    });
}

TEST(PointTransform, KnowsWhichPointsLieInTheMesh) {
    const PointTransform transform(test::deformed_by(test::box_at({0, 0, 0}, {10, 10, 10}, {2, 2, 2}),
                                                     [](const auto&) { return Eigen::Vector3d(50, 0, 0); }));
    Eigen::Matrix3Xd points(3, 3);
    points << 5, 11, 55, 5, 5, 5, 5, 5, 5;
    EXPECT_EQ(transform.inside(points), (std::vector<bool>{true, false, false}));
}

TEST(InversePointTransform, LeadsBackInsideAndOutside) {
    for (const double height : {9.0, -9.0}) {
        Deformation deformation =
            test::deformed_by(test::ball({0, 0, 0}, 40.0, 10), [&](const auto& X) { return bump(X, height); });
        deformation.placement = test::motion(-7.0, {0.5, 0, 1}, {2, 2, -3});
        const Geometry grid = test::oblique_grid({10, 0, 0}, {13, 12, 11}, {9.1, 9.3, 9.7});
        const Volume places(grid, CV_8UC1);
        Eigen::Matrix3Xd X(3, grid.voxel_count());
        for_each_voxel(places, [&](const Eigen::Vector3d& index, std::int64_t n) { X.col(n) = grid.point(index); });
        const Eigen::Matrix3Xd y = PointTransform(deformation)(X);
        const Eigen::Matrix3Xd back = InversePointTransform(deformation)(y);
        EXPECT_LT((back - X).colwise().norm().maxCoeff(), 1e-4) << height;
        EXPECT_LT((PointTransform(deformation)(back) - y).colwise().norm().maxCoeff(), 2e-5) << height;
    }
}

TEST(InversePointTransform, RefusesPointsThatAreNone) {
    const InversePointTransform inverse(test::deformed_by(test::box_at({0, 0, 0}, {10, 10, 10}, {2, 2, 2}),
                                                          [](const auto&) { return Eigen::Vector3d(50, 0, 0); }));
    EXPECT_THROW((void)inverse(Eigen::Vector3d(0, std::nan(""), 0)), InvalidInput);
    EXPECT_LT((inverse(Eigen::Vector3d(55, 5, 5)).col(0) - Eigen::Vector3d(5, 5, 5)).norm(), 1e-9);
}

TEST(JacobianDeterminant, OfAnAffineFieldIsItsDeterminant) {
    const Geometry grid = test::oblique_grid({3, 4, 5}, {9, 8, 7}, {0.7, 1.3, 2.1});
    Volume field(grid, CV_32FC3);
    for_each_voxel(field, [&](const Eigen::Vector3d& index, std::int64_t n) {
        const Eigen::Vector3d d = affine_displacement(grid.point(index));
        for (int c = 0; c < 3; ++c) field.data<cv::Vec3f>()[n][c] = static_cast<float>(d[c]);
    });
    const Volume jacobian = jacobian_determinant(field);
    const double expected = (Eigen::Matrix3d::Identity() + affine).determinant();
    for_each_voxel(jacobian,
                   [&](const auto&, std::int64_t n) { ASSERT_NEAR(jacobian.data<float>()[n], expected, 1e-5); });
}

TEST(JacobianDeterminant, OfARotationIsOne) {
    Deformation deformation = test::deformed_by(test::box_at({0, 0, 0}, {20, 20, 20}, {3, 3, 3}),
                                                [](const auto&) -> Eigen::Vector3d { return Eigen::Vector3d::Zero(); });
    deformation.placement = test::motion(40.0, {1, -1, 2}, {0, 5, 0});
    const Geometry grid = test::oblique_grid({10, 10, 10}, {25, 23, 21}, {1.2, 1.5, 1.9});
    const JacobianReport report = field_jacobians(displacement_moving_to_fixed(deformation, grid));
    EXPECT_NEAR(report.minimum, 1.0, 1e-4);
    EXPECT_NEAR(report.maximum, 1.0, 1e-4);
    EXPECT_EQ(report.folded, 0);
}

TEST(JacobianDeterminant, TakesOneSidedDifferencesAtTheBorderAndNoneAlongASingleVoxel) {
    const Geometry grid = test::plain_grid({4, 3, 1}, 2.0);
    Volume field(grid, CV_32FC3);
    for_each_voxel(field, [&](const Eigen::Vector3d& index, std::int64_t n) {
        field.data<cv::Vec3f>()[n] = cv::Vec3f(static_cast<float>(index[0]), 0.0F, 0.0F);  // ∂d/∂x = 1/2
    });
    const Volume jacobian = jacobian_determinant(field);
    for_each_voxel(jacobian, [&](const auto&, std::int64_t n) { EXPECT_FLOAT_EQ(jacobian.data<float>()[n], 1.5F); });
}

TEST(Field, SaysNothingOfInversionOnALeftHandedGrid) {
    tissuewarp::test::Noted observer;
    const Deformation deformation =
        test::deformed_by(test::box_at({0, 0, 0}, {30, 30, 30}, {3, 3, 3}), affine_displacement);
    displacement_fixed_to_moving(deformation, test::oblique_grid({15, 15, 15}, {31, 31, 31}, {1, 1, 1}), {}, observer);
    EXPECT_EQ(observer.notes, "");
}

TEST(Field, SaysHowManyTetrahedraAreInverted) {
    tissuewarp::test::Noted observer;
    Deformation deformation = test::deformed_by(test::box_at({0, 0, 0}, {30, 30, 30}, {3, 3, 3}),
                                                [](const auto&) -> Eigen::Vector3d { return Eigen::Vector3d::Zero(); });
    deformation.displacement.col(1 + 4 * (1 + 4)) = Eigen::Vector3d(14, 0, 0);  // an inner node past its neighbour
    const Geometry grid = test::plain_grid({31, 31, 31});
    const Volume field = displacement_fixed_to_moving(deformation, grid, {}, observer);
    EXPECT_NE(observer.notes.find("inverted"), std::string::npos);
    EXPECT_LT(cv::norm(field.voxels, cv::NORM_INF), 14.001);
    const JacobianReport report = mesh_jacobians(deformation);
    EXPECT_GT(report.folded, 0);
    EXPECT_NE(observer.notes.find(std::to_string(report.folded) + " inverted"), std::string::npos);
    EXPECT_GT(field_jacobians(displacement_moving_to_fixed(deformation, grid)).folded, 0);
}

TEST(Field, RefusesWhatItCannotUse) {
    const Deformation good = test::deformed_by(test::box_at({0, 0, 0}, {30, 30, 30}, {3, 3, 3}), affine_displacement);
    const Geometry grid = test::plain_grid({9, 9, 9});
    Deformation bad = good;
    bad.displacement(1, 7) = std::nan("");
    EXPECT_THROW(displacement_moving_to_fixed(bad, grid), InvalidInput);
    bad = good;
    bad.displacement.conservativeResize(3, 10);
    EXPECT_THROW(displacement_fixed_to_moving(bad, grid), InvalidInput);
    EXPECT_THROW(displacement_fixed_to_moving(good, grid, {.fade_mm = 0.0}), InvalidInput);
    EXPECT_THROW(displacement_fixed_to_moving(good, Geometry{}), InvalidInput);
    const PointTransform transform(good);
    EXPECT_THROW(transform(Eigen::Vector3d(0, std::nan(""), 0)), InvalidInput);
    EXPECT_THROW(jacobian_determinant(Volume(grid, CV_32FC1)), InvalidInput);
}

TEST(Field, StopsWhenAsked) {
    struct Impatient : Observer {
        bool cancel_requested() override { return true; }
    } observer;
    const Deformation deformation =
        test::deformed_by(test::box_at({0, 0, 0}, {30, 30, 30}, {3, 3, 3}), affine_displacement);
    EXPECT_THROW(displacement_moving_to_fixed(deformation, test::plain_grid({9, 9, 9}), {}, observer), Cancelled);
}

/// The field of the independent phantom at a point, trilinear between its voxels.
Eigen::Vector3d sample(const Volume& field, const Eigen::Vector3d& point) {
    const Eigen::Vector3d index = field.geometry.index(point);
    Eigen::Vector3d value = Eigen::Vector3d::Zero();
    for (int corner = 0; corner < 8; ++corner) {
        double weight = 1.0;
        std::array<int, 3> voxel;
        for (int axis = 0; axis < 3; ++axis) {
            const double clamped = std::clamp(index[axis], 0.0, field.geometry.size[axis] - 1.0);
            const int lower = std::min(static_cast<int>(clamped), field.geometry.size[axis] - 2);
            const int bit = corner >> axis & 1;
            voxel[axis] = lower + bit;
            weight *= bit ? clamped - lower : 1.0 - (clamped - lower);
        }
        value += weight * vector_at(field, field.offset(voxel[0], voxel[1], voxel[2]));
    }
    return value;
}

TEST(PointTransform, CarriesLandmarksOfTheBrainShiftPhantomByItsTrueField) {
    const std::filesystem::path folder = tissuewarp::test::source_folder() / "data/brainshift";
    const Volume truth = imaging::read_volume(folder / "truth_forward.nii.gz");
    const Landmarks landmarks = read_landmarks(folder / "landmarks.csv");
    const Eigen::Vector3d lower = landmarks.moving.rowwise().minCoeff().array() - 4.0;
    const Eigen::Vector3d upper = landmarks.moving.rowwise().maxCoeff().array() + 4.0;
    const Eigen::Vector3d size = upper - lower;
    const auto cells = [&](int axis) { return static_cast<int>(std::ceil(size[axis] / 4.0)); };
    const Deformation deformation = test::deformed_by(test::box_at(lower, size, {cells(0), cells(1), cells(2)}),
                                                      [&](const Eigen::Vector3d& X) { return sample(truth, X); });
    const TargetError error = target_error(landmarks, PointTransform(deformation)(landmarks.moving));
    EXPECT_EQ(error.before.count, 220);
    EXPECT_EQ(error.moved_before.count, 57);
    EXPECT_NEAR(error.moved_before.mean, 3.8, 0.05);
    EXPECT_LT(error.after.mean, 0.1);
}

}  // namespace
}  // namespace tissuewarp::registration
