#include "core/errors.hpp"
#include "test_volumes.hpp"

#include <gmock/gmock.h>

#include <limits>

namespace tissuewarp::imaging {
namespace {

using test::oblique_grid;

TEST(Geometry, PointOfAnIndexFollowsOriginDirectionAndSpacing) {
    Geometry grid = test::plain_grid({4, 4, 4}, {2, 3, 4});
    grid.origin = {10, 20, 30};
    grid.direction << 0, -1, 0, 1, 0, 0, 0, 0, 1;  // i along +y, j along -x
    EXPECT_TRUE(grid.point({1, 1, 1}).isApprox(Eigen::Vector3d(7, 22, 34), 1e-15));
}

TEST(Geometry, IndexInvertsPointOnObliqueAndLeftHandedGrids) {
    for (const bool left_handed : {false, true}) {
        const Geometry grid = oblique_grid({7, 9, 11}, left_handed);
        const Eigen::Vector3d index(1.25, -3.5, 100.0);
        EXPECT_LT((grid.index(grid.point(index)) - index).norm(), 1e-12);
        EXPECT_LT((grid.point_to_index() * grid.index_to_point() - Eigen::Matrix3d::Identity()).norm(), 1e-14);
    }
}

TEST(Geometry, CountsVoxelsBeyondThirtyTwoBits) {
    EXPECT_EQ(test::plain_grid({4000, 4000, 4000}).voxel_count(), 64'000'000'000LL);
    EXPECT_DOUBLE_EQ(oblique_grid().voxel_volume(), 0.75 * 1.25 * 2.5);
}

TEST(Geometry, GridDistanceIsTheLargestCornerDistanceInVoxels) {
    const Geometry a = test::plain_grid({11, 11, 11}, {2, 2, 2});
    Geometry b = a;
    b.origin[1] += 0.5;
    EXPECT_NEAR(grid_distance(a, b), 0.25, 1e-14);
    b = a;
    b.spacing[0] = 2.2;  // the far corners lie 10 * 0.2 mm off
    EXPECT_NEAR(grid_distance(a, b), 1.0, 1e-12);
}

TEST(Geometry, GridsOfDifferentSizeAreInfinitelyFar) {
    EXPECT_EQ(grid_distance(test::plain_grid({3, 3, 3}), test::plain_grid({3, 3, 4})),
              std::numeric_limits<double>::infinity());
}

TEST(Geometry, HeadersThatDifferInTheSeventhDigitAreTheSameGrid) {
    const Geometry a = oblique_grid();
    Geometry b = a;
    b.origin *= 1.0 + 1e-7;
    b.spacing *= 1.0 - 1e-7;
    EXPECT_TRUE(same_grid(a, b));
    b.origin[0] += 0.01;
    EXPECT_FALSE(same_grid(a, b));
}

TEST(Geometry, ANonFiniteHeaderIsNotTheSameGrid) {
    Geometry b = oblique_grid();
    b.origin[2] = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(same_grid(oblique_grid(), b));
}

TEST(Geometry, ValidGridsOfEitherHandednessPass) {
    EXPECT_NO_THROW(require_valid(oblique_grid(), "grid"));
    EXPECT_NO_THROW(require_valid(oblique_grid({7, 9, 11}, true), "grid"));
}

TEST(Geometry, RefusesZeroSizeBadSpacingAndSkewedAxes) {
    Geometry grid = oblique_grid();
    grid.size[1] = 0;
    EXPECT_THAT(test::message_of<InvalidInput>([&] { require_valid(grid, "preop"); }),
                testing::HasSubstr("preop: size 7 x 0"));
    for (const double spacing :
         {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
        grid = oblique_grid();
        grid.spacing[2] = spacing;
        EXPECT_THROW(require_valid(grid, "grid"), InvalidInput) << spacing;
    }
    grid = oblique_grid();
    grid.direction(0, 0) += 0.01;
    EXPECT_THROW(require_valid(grid, "grid"), InvalidInput);
    grid.direction(0, 0) = std::numeric_limits<double>::quiet_NaN();
    EXPECT_THROW(require_valid(grid, "grid"), InvalidInput);
}

TEST(VolumeTest, VoxelsAreOrderedSliceRowColumn) {
    Volume volume(test::plain_grid({3, 4, 5}), CV_16SC1);
    EXPECT_EQ(volume.voxels.size[0], 5);
    EXPECT_EQ(volume.voxels.size[2], 3);
    volume.data<short>()[volume.offset(2, 1, 3)] = 7;
    EXPECT_EQ(volume.voxels.at<short>(3, 1, 2), 7);
}

TEST(VolumeTest, RefusesVoxelsThatDisagreeWithTheGeometry) {
    const int sizes[3] = {3, 4, 5};
    EXPECT_THROW(Volume(test::plain_grid({3, 4, 5}), cv::Mat(3, sizes, CV_8U)), InvalidInput);
    EXPECT_NO_THROW(Volume(test::plain_grid({5, 4, 3}), cv::Mat(3, sizes, CV_8U)));
    EXPECT_THROW(Volume(test::plain_grid({5, 4, 1}), cv::Mat(4, 5, CV_8U)), InvalidInput);
}

TEST(VolumeTest, ConversionSaturates) {
    Volume volume(test::plain_grid({2, 2, 2}), CV_32SC1);
    volume.data<int>()[0] = 300;
    volume.data<int>()[1] = -5;
    const Volume bytes = volume.as(CV_8U);
    EXPECT_EQ(bytes.data<std::uint8_t>()[0], 255);
    EXPECT_EQ(bytes.data<std::uint8_t>()[1], 0);
}

}  // namespace
}  // namespace tissuewarp::imaging
