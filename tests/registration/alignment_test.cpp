/// Rigid alignment of labels to known motions.
#include "registration/pose/alignment.hpp"
#include "registration/pose/label_distance.hpp"

#include "imaging/filters.hpp"
#include "imaging/label_extents.hpp"
#include "tests/support/label_shapes.hpp"

#include <gtest/gtest.h>

namespace tissuewarp::registration {
namespace {

using shapes::organ_labels;

/// Largest distance between two rigid motions over the organ's bounding box, mm.
double pose_error(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
    double worst = 0;
    for (int corner = 0; corner < 8; ++corner) {
        const Eigen::Vector3d x(corner & 1 ? 45 : -45, corner & 2 ? 35 : -35, corner & 4 ? 30 : -30);
        worst = std::max(worst, (a * x - b * x).norm());
    }
    return worst;
}

class KnownMotions : public ::testing::TestWithParam<Eigen::Isometry3d> {};

INSTANTIATE_TEST_SUITE_P(Small, KnownMotions,
                         ::testing::Values(Eigen::Isometry3d::Identity(), shapes::motion(5, {1, 2, 3}, {4, -3, 2}),
                                           shapes::motion(-25, {0, 1, 1}, {-8, 6, 3})),
                         [](const auto& each) { return "Motion" + std::to_string(each.index); });

TEST_P(KnownMotions, AreFoundToAVoxel) {
    const auto moving = organ_labels({}), fixed = organ_labels({}, GetParam());
    const Alignment found = align_labels(moving, fixed);
    EXPECT_LT(pose_error(found.placement, GetParam()), 1.5);  // 1.27 at most, of voxels of 1.5 mm
    detail::LabelBoundaries of_moving(moving), of_fixed(fixed);
    const detail::LabelDistance distance(of_moving, of_fixed, AlignmentOptions().samples);
    const double truth_mm = distance(Eigen::Affine3d(GetParam().matrix()), AlignmentOptions().trim_mm, 1);
    EXPECT_LE(found.mean_distance_mm, truth_mm);  // voxels' faces fit no better where the organ truly is
    EXPECT_LT(found.mean_distance_mm, 0.38);
}

/// The background that lies about it.
TEST(Alignment, IsThatOfTheOrganHoweverWideItsImages) {
    const auto wide = organ_labels({}), seen = organ_labels({}, shapes::motion(8, {1, 2, 3}, {6, -3, 2}));
    const auto box = grown(extent_of_all(imaging::label_extents(wide)), {3, 3, 3}, wide.geometry);
    const auto cut = part_of(wide.as(CV_8U), box);
    EXPECT_LT(pose_error(align_labels(cut, seen).placement, align_labels(wide, seen).placement),
              0.1);  // 0.063, of voxels of 1.5 mm
}

TEST(Alignment, ABallIsNotTurned) {
    const shapes::Organ ball{{0, 0, 0}, {30, 30, 30}, {0, 0, 0}, 0};
    const auto expected = shapes::motion(0, {1, 0, 0}, {3, 0, 0});
    EXPECT_LT(pose_error(align_labels(organ_labels(ball), organ_labels(ball, expected)).placement, expected), 0.01);
}

TEST(Alignment, HeadersInOtherAxesAreHonoured) {
    Eigen::Matrix3d turned;
    turned << 0, -1, 0, 0, 0, 1, 1, 0, 0;
    const auto expected = shapes::motion(10, {1, 0, 0}, {2, 2, -3});
    const Alignment found = align_labels(organ_labels({}), organ_labels({}, expected, 1.5, turned));
    EXPECT_LT(pose_error(found.placement, expected), 1.1);
}

TEST(Alignment, FarApartHeadersAreBroughtTogether) {
    auto fixed = organ_labels({});
    const Eigen::Vector3d shift(200, -150, 90);
    fixed.geometry.origin += shift;
    const auto expected = shapes::motion(0, {1, 0, 0}, shift);
    EXPECT_LT(pose_error(align_labels(organ_labels({}), fixed).placement, expected), 0.01);
}

TEST(Alignment, MapsWithoutACommonLabelAreRefused) {
    const auto moving = organ_labels({});
    auto fixed = organ_labels({});
    fixed.voxels.setTo(7, fixed.voxels > 0);
    EXPECT_THROW(align_labels(moving, fixed), InvalidInput);
}

TEST(Alignment, SameResultEveryTime) {
    const auto moving = organ_labels({}), fixed = organ_labels({}, shapes::motion(5, {1, 2, 3}, {4, -3, 2}));
    EXPECT_EQ(align_labels(moving, fixed).placement.matrix(), align_labels(moving, fixed).placement.matrix());
}

/// Nodes and triangles of the organ's ellipsoid.
meshing::SurfaceMesh ellipsoid() {
    constexpr int rings = 24, sectors = 48;
    meshing::SurfaceMesh surface;
    surface.nodes.resize(3, (rings + 1) * sectors);
    for (int r = 0; r <= rings; ++r)
        for (int s = 0; s < sectors; ++s) {
            const double theta = EIGEN_PI * (r + 0.5) / (rings + 1), phi = 2 * EIGEN_PI * s / sectors;
            const Eigen::Vector3d n(std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta));
            surface.nodes.col(r * sectors + s) = n.cwiseProduct(shapes::Organ{}.semi_axes);
        }
    surface.triangles.resize(3, 2 * rings * sectors);
    for (int r = 0; r < rings; ++r)
        for (int s = 0; s < sectors; ++s) {
            const int a = r * sectors + s, b = r * sectors + (s + 1) % sectors;
            surface.triangles.col(2 * a) << a, a + sectors, b;
            surface.triangles.col(2 * a + 1) << b, a + sectors, b + sectors;
        }
    return surface;
}

TEST(SurfaceAlignment, APartOfASurfaceIsEnough) {
    const auto surface = ellipsoid();
    const auto expected = shapes::motion(12, {1, 2, 0}, {6, -4, 3});
    std::vector<int> seen;
    for (int node = 0; node < surface.node_count(); ++node)
        if (surface.nodes(1, node) < 10) seen.push_back(node);
    ASSERT_LT(double(seen.size()), 0.75 * surface.node_count());
    const Eigen::Matrix3Xd part = expected * surface.nodes(Eigen::all, seen).eval();
    const Alignment found = align_surfaces(surface, {part, Eigen::Matrix3Xd(3, 0), 0.5});
    EXPECT_LT(pose_error(found.placement, expected), 1e-4);
    EXPECT_LT(found.mean_distance_mm, 1e-4);  // points against a dense sample of the surface
}

TEST(SurfaceAlignment, EmptyAndNonFiniteInputIsRefused) {
    const auto surface = ellipsoid();
    EXPECT_THROW(align_surfaces(surface, SurfacePoints{}), InvalidInput);
    Eigen::Matrix3Xd bad = surface.nodes;
    bad(1, 5) = NAN;
    EXPECT_THROW(align_surfaces(surface, {bad, Eigen::Matrix3Xd(3, 0), 0.5}), InvalidInput);
}

}  // namespace
}  // namespace tissuewarp::registration
