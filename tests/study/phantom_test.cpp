/// Random phantoms: the same again, what is true of them, what they refuse.
#include "study/phantom.hpp"

#include "core/errors.hpp"
#include "imaging/sampling.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

namespace tissuewarp::study {
namespace {

TEST(RandomPhantom, TheSameSeedGivesTheSameBits) {
    const Phantom once = random_phantom(5), again = random_phantom(5);
    EXPECT_EQ(once.story, again.story);
    EXPECT_EQ(once.targets.fixed, again.targets.fixed);
    EXPECT_EQ(once.surface.points, again.surface.points);
    EXPECT_EQ(once.points.fixed, again.points.fixed);
    const auto voxels = once.fixed_labels.geometry.voxel_count();
    ASSERT_EQ(voxels, again.fixed_labels.geometry.voxel_count());
    const auto* labels = once.fixed_labels.data<std::int32_t>();
    EXPECT_TRUE(std::equal(labels, labels + voxels, again.fixed_labels.data<std::int32_t>()));
}

double share_in(const imaging::Volume& labels, const Eigen::Matrix3Xd& points) {
    int inside = 0;
    for (const auto& point : points.colwise()) inside += imaging::nearest_value<std::int32_t>(labels, point) > 0;
    return inside / double(points.cols());
}

// Targets mapped in the wrong direction, or by another placement than the labels, would lie up to 25 mm off.
TEST(RandomPhantom, TargetsLieInTheOrganBeforeAndAfter) {
    const Phantom phantom = random_phantom(6, {.voxel_mm = 1.5, .boundary_deviation_mm = 0, .targets = 400});
    ASSERT_EQ(phantom.targets.moving.cols(), 400);
    EXPECT_GT((phantom.targets.fixed - phantom.targets.moving).colwise().norm().mean(), 3);
    EXPECT_GT(share_in(phantom.moving_labels, phantom.targets.moving), 0.98);
    EXPECT_GT(share_in(phantom.fixed_labels, phantom.targets.fixed), 0.98);
    EXPECT_LT(share_in(phantom.moving_labels, phantom.targets.fixed), 0.95);
}

TEST(RandomPhantom, OtherSeedsGiveOtherOrgans) {
    const Phantom one = random_phantom(5), other = random_phantom(6);
    EXPECT_NE(one.story, other.story);
    EXPECT_GE(other.points.moving.cols(), 4);
    EXPECT_LE(other.points.moving.cols(), 10);
    EXPECT_GT(other.surface.points.cols(), 200);
}

TEST(RandomPhantom, RefusesWhatCannotBeDrawn) {
    const auto refused = [](const PhantomOptions& options) {
        EXPECT_THROW(static_cast<void>(random_phantom(1, options)), InvalidInput);
    };
    refused({.voxel_mm = 0});
    refused({.voxel_mm = 50});
    refused({.boundary_deviation_mm = -1});
    refused({.point_deviation_mm = std::numeric_limits<double>::quiet_NaN()});
    refused({.targets = 0});
}

}  // namespace
}  // namespace tissuewarp::study
