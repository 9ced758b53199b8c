/// The closest point of a surface, beside a search of all triangles.
#include "meshing/search/surface_tree.hpp"

#include "core/errors.hpp"
#include "meshing/primitives.hpp"
#include "tests/support/numbers.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include <cmath>

namespace tissuewarp::meshing {
namespace {

using Eigen::Vector3d;

using test::Numbers;

/// A lattice: many points are as near to several triangles.
SurfaceMesh box_surface() {
    return boundary_surface(box_mesh({12, 10, 8}, {6, 5, 4})).surface;
}

SurfaceMesh uneven_surface() {
    SurfaceMesh surface = boundary_surface(box_mesh({60, 50, 40}, {9, 8, 7}, 0.2)).surface;
    surface.nodes.colwise() -= Vector3d(30, 25, 20);
    return surface;
}

Vector3d normal_of(const SurfaceMesh& surface, Eigen::Index t) {
    const Eigen::Matrix3d corners = surface.nodes(Eigen::all, surface.triangles.col(t));
    return (corners.col(1) - corners.col(0)).cross(corners.col(2) - corners.col(0)).normalized();
}

/// The simple twin: every triangle is looked at.
SurfaceTree::Hit closest_of_all(const SurfaceMesh& surface, const Vector3d& point, const NormalGate& gate) {
    SurfaceTree::Hit best;
    best.distance = 1e30;
    for (int t = 0; t < surface.triangle_count(); ++t) {
        const double cosine = gate.normal.dot(normal_of(surface, t));
        if ((gate.oriented ? cosine : std::abs(cosine)) < gate.least_cosine) continue;
        const Eigen::Matrix3d corners = surface.nodes(Eigen::all, surface.triangles.col(t));
        const Vector3d weights = closest_in_triangle(corners.col(1) - corners.col(0), corners.col(2) - corners.col(0),
                                                     point - corners.col(0));
        const double distance = (corners * weights - point).norm();
        if (distance < best.distance) best = {t, weights, corners * weights, Vector3d::Zero(), distance};
    }
    return best;
}

TEST(SurfaceTree, AgreesWithLookingAtEveryTriangle) {
    const auto surface = uneven_surface();
    const SurfaceTree tree(surface);
    Numbers numbers(1);
    int gated = 0;
    for (int n = 0; n < 400; ++n) {
        const Vector3d point = 70 * numbers.in_cube();
        const NormalGate gate{numbers.direction(), n % 3 == 0 ? -1.0 : 0.6, n % 2 == 0};
        const auto expected = closest_of_all(surface, point, gate);
        const auto found = tree.closest(point, 1e3, gate);
        ASSERT_TRUE(found);
        EXPECT_NEAR(found->distance, expected.distance, 1e-9) << n;
        EXPECT_NEAR((found->point - expected.point).norm(), 0, 1e-9) << n;
        EXPECT_NEAR(
            (surface.nodes(Eigen::all, surface.triangles.col(found->triangle)) * found->barycentric - found->point)
                .norm(),
            0, 1e-9);
        gated += std::abs(expected.distance - closest_of_all(surface, point, {}).distance) > 1e-6;
        EXPECT_FALSE(tree.closest(point, 0.99 * expected.distance, gate)) << n;
    }
    EXPECT_GT(gated, 50);  // the gate decided
}

TEST(SurfaceTree, AGuessChangesNothing) {
    for (const SurfaceMesh& surface : {uneven_surface(), box_surface()}) {
        const SurfaceTree tree(surface);
        Numbers numbers(2);
        for (int n = 0; n < 2000; ++n) {
            const Vector3d point = (30 * numbers.in_cube()).array().round();  // on the box many triangles are as near
            const NormalGate gate{numbers.direction(), n % 3 == 0 ? -1.0 : 0.6, n % 2 == 0};
            const double reach = n % 5 == 0 ? 2 : 1e3;
            const auto without = tree.closest(point, reach, gate);
            const auto with = tree.closest(point, reach, gate, 7 * n % surface.triangle_count());
            ASSERT_EQ(bool(without), bool(with)) << n;
            if (!with) continue;
            EXPECT_EQ(with->triangle, without->triangle) << n;
            EXPECT_EQ(with->point, without->point) << n;
        }
    }
}

TEST(SurfaceTree, OfTrianglesAsNearTheFirstIsTaken) {
    const SurfaceMesh surface = box_surface();
    const SurfaceTree tree(surface);
    for (int n = 0; n < 13 * 11 * 9; ++n) {
        const Vector3d point(n % 13, n / 13 % 11, n / (13 * 11));
        const auto expected = closest_of_all(surface, point, {});
        const auto found = tree.closest(point, 1e3);
        ASSERT_TRUE(found);
        EXPECT_EQ(found->triangle, expected.triangle) << point.transpose();
        EXPECT_EQ(found->distance, expected.distance) << point.transpose();
    }
}

TEST(SurfaceTree, ASurfaceWithoutTrianglesIsRefused) {
    EXPECT_THROW(SurfaceTree(SurfaceMesh{}), InvalidInput);
}

}  // namespace
}  // namespace tissuewarp::meshing
