/// Rigid alignment of labels to known motions.
#include "registration/alignment.hpp"

#include "imaging/filters.hpp"
#include "tests/support/label_shapes.hpp"

#include <gtest/gtest.h>

namespace tissuewarp::registration {
namespace {

using shapes::organ_labels;

constexpr double voxel_mm =
    1.5;  // of the label maps: boundaries are known to a fraction of it, poses at the corners less well

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
    EXPECT_LT(pose_error(found.placement, GetParam()), voxel_mm);
    EXPECT_LT(found.mean_distance_mm, voxel_mm / 2);
}

TEST(Alignment, ABallIsNotTurned) {
    const shapes::Organ ball{{0, 0, 0}, {30, 30, 30}, {0, 0, 0}, 0};
    const auto expected = shapes::motion(0, {1, 0, 0}, {3, 0, 0});
    EXPECT_LT(pose_error(align_labels(organ_labels(ball), organ_labels(ball, expected)).placement, expected), voxel_mm);
}

TEST(Alignment, HeadersInOtherAxesAreHonoured) {
    Eigen::Matrix3d turned;
    turned << 0, -1, 0, 0, 0, 1, 1, 0, 0;
    const auto expected = shapes::motion(10, {1, 0, 0}, {2, 2, -3});
    const Alignment found = align_labels(organ_labels({}), organ_labels({}, expected, 1.5, turned));
    EXPECT_LT(pose_error(found.placement, expected), voxel_mm);
}

TEST(Alignment, FarApartHeadersAreBroughtTogether) {
    auto fixed = organ_labels({});
    const Eigen::Vector3d shift(200, -150, 90);
    fixed.geometry.origin += shift;
    const auto expected = shapes::motion(0, {1, 0, 0}, shift);
    EXPECT_LT(pose_error(align_labels(organ_labels({}), fixed).placement, expected), voxel_mm);
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

}  // namespace
}  // namespace tissuewarp::registration
