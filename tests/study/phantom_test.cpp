/// Random phantoms: the same again, what is true of them, what they refuse.
#include "study/phantom.hpp"

#include "core/errors.hpp"
#include "imaging/labels.hpp"
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
