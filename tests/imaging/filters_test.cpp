#include "imaging/filters.hpp"
#include "core/errors.hpp"
#include "test_volumes.hpp"

#include <gmock/gmock.h>
#include <tbb/global_control.h>

#include <limits>

namespace tissuewarp::imaging {
namespace {

using test::oblique_grid;
using test::plain_grid;

const Eigen::Vector3d slope(0.3, -0.7, 1.1);  // of the linear test function, per mm in LPS

/// 5 + slope · point at every voxel.
Volume linear_volume(const Geometry& grid, int depth = CV_64F) {
    Volume volume(grid, CV_64F);
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i)
                volume.data<double>()[volume.offset(i, j, k)] =
                    5.0 + slope.dot(grid.point({1.0 * i, 1.0 * j, 1.0 * k}));
    return volume.as(depth);
}

Volume random_mask(const Geometry& grid, int percent, unsigned seed) {
    Volume mask = test::random_volume(grid, CV_8U, seed);
    for (long long i = 0; i < grid.voxel_count(); ++i)
        mask.data<std::uint8_t>()[i] = mask.data<std::uint8_t>()[i] < percent ? 1 : 0;
    return mask;
}

std::vector<Eigen::Vector3d> all_indices(const Geometry& grid) {
    std::vector<Eigen::Vector3d> indices;
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i) indices.emplace_back(i, j, k);
    return indices;
}

// --- smoothing and gradient

TEST(Smooth, AnImpulseBecomesTheGaussian) {
    const Geometry grid = plain_grid({41, 31, 25}, {0.5, 1.0, 1.5});
    Volume impulse(grid, CV_32F);
    impulse.data<float>()[impulse.offset(20, 15, 12)] = 1000.0F;
    const double sigma = 2.0;
    const Volume smoothed = smooth(impulse, sigma);
    for (const Eigen::Vector3d& index : all_indices(grid)) {
        const Eigen::Vector3d r = grid.spacing.cwiseProduct(index - Eigen::Vector3d(20, 15, 12));
        const double expected = 1000.0 * grid.voxel_volume() * std::exp(-r.squaredNorm() / (2 * sigma * sigma)) /
                                std::pow(2 * M_PI * sigma * sigma, 1.5);
        const float value = smoothed.data<float>()[smoothed.offset(int(index[0]), int(index[1]), int(index[2]))];
        // 3e-4 of the peak: the kernel stops at 4 standard deviations and is normalised.
        ASSERT_NEAR(value, expected, 3e-4 * 1000.0 * grid.voxel_volume() / std::pow(2 * M_PI * sigma * sigma, 1.5));
    }
}

TEST(Smooth, KeepsAConstantUpToTheBorder) {
    Volume constant(oblique_grid(), CV_16S);
    constant.voxels.setTo(1234);
    const Volume smoothed = smooth(constant, 3.0);
    EXPECT_EQ(smoothed.voxels.type(), CV_32FC1);
    double low = 0.0, high = 0.0;
    cv::minMaxIdx(smoothed.voxels, &low, &high);
    EXPECT_NEAR(low, 1234.0, 1e-3);
    EXPECT_NEAR(high, 1234.0, 1e-3);
}

TEST(Smooth, ZeroWidthCopiesAndNegativeIsRefused) {
    const Volume image = test::random_volume(oblique_grid(), CV_32F);
    const Volume copy = smooth(image, 0.0);
    EXPECT_TRUE(test::same_voxels(copy.voxels, image.voxels));
    EXPECT_NE(copy.voxels.data, image.voxels.data);
    EXPECT_THROW(smooth(image, -1.0), InvalidInput);
    EXPECT_THROW(smooth(image, std::numeric_limits<double>::quiet_NaN()), InvalidInput);
}

TEST(Smooth, DoesNotChangeItsInput) {
    const Volume image = test::random_volume(oblique_grid(), CV_32F);
    const Volume before = image.clone();
    smooth(image, 1.0);
    EXPECT_TRUE(test::same_voxels(image.voxels, before.voxels));
}

TEST(Gradient, OfALinearFunctionIsExactInObliqueAxes) {
    for (const bool left_handed : {false, true}) {
        const Volume result = gradient(linear_volume(oblique_grid({7, 9, 11}, left_handed), CV_32F));
        ASSERT_EQ(result.voxels.type(), CV_32FC3);
        for (long long i = 0; i < result.geometry.voxel_count(); ++i)
            ASSERT_LT(
                (Eigen::Map<const Eigen::Vector3f>(result.voxels.ptr<float>() + 3 * i).cast<double>() - slope).norm(),
                1e-4);
    }
}

// --- resampling

TEST(Resample, ALinearFunctionIsExactOnAnObliqueGrid) {
    const Volume image = linear_volume(oblique_grid({30, 30, 20}));
    Geometry target = plain_grid({5, 6, 7}, {0.9, 0.8, 1.1});
    target.origin = image.geometry.point({12, 13, 9});
    const Volume result = resample(image, target, Interpolation::Linear, -1e9);
    const Volume expected = linear_volume(target);
    EXPECT_LT(test::largest_difference(result.voxels, expected.voxels), 1e-9);
}

TEST(Resample, OntoItsOwnGridIsTheIdentityForEveryType) {
    for (const int type : {CV_8UC1, CV_8SC1, CV_16UC1, CV_16SC1, CV_32SC1, CV_32FC1, CV_64FC1, CV_32FC3})
        for (const auto interpolation : {Interpolation::Nearest, Interpolation::Linear}) {
            const Volume image = test::random_volume(oblique_grid(), type);
            const Volume result = resample(image, image.geometry, interpolation, 0.0);
            if (type == CV_32FC1 || type == CV_64FC1 || type == CV_32FC3)
                EXPECT_LT(test::largest_difference(result.voxels, image.voxels), 1e-4) << type;
            else
                EXPECT_TRUE(test::same_voxels(result.voxels, image.voxels)) << type;
        }
}

TEST(Resample, TheEdgeReachesHalfAVoxelOut) {
    Volume image(plain_grid({4, 4, 4}), CV_32F);
    image.voxels.setTo(7.0F);
    Geometry target = plain_grid({9, 1, 1}, {0.25, 1, 1});
    target.origin = {-1.0, 1.0, 1.0};  // -1, -0.75, -0.5, ..., 1
    for (const auto interpolation : {Interpolation::Nearest, Interpolation::Linear}) {
        const Volume result = resample(image, target, interpolation, -3.0);
        const std::vector<float> values(result.data<float>(), result.data<float>() + 9);
        EXPECT_EQ(values, (std::vector<float>{-3, -3, 7, 7, 7, 7, 7, 7, 7}));
    }
}

TEST(Resample, NearestTakesNoNewValues) {
    const Volume labels = test::random_volume(plain_grid({8, 8, 8}), CV_8U);
    Geometry target = oblique_grid({10, 10, 10});
    target.spacing = {0.3, 0.3, 0.3};
    target.origin = {3, 3, 3};
    const Volume result = resample(labels, target, Interpolation::Nearest, 0);
    for (const Eigen::Vector3d& index : all_indices(target)) {
        const Eigen::Vector3d at = labels.geometry.index(target.point(index));
        const int i = int(std::floor(at[0] + 0.5)), j = int(std::floor(at[1] + 0.5)), k = int(std::floor(at[2] + 0.5));
        const bool inside = std::min({i, j, k}) >= 0 && std::max({i, j, k}) < 8;
        ASSERT_EQ(result.data<std::uint8_t>()[result.offset(int(index[0]), int(index[1]), int(index[2]))],
                  inside ? labels.data<std::uint8_t>()[labels.offset(i, j, k)] : 0);
    }
}

TEST(Resample, IntegersAreRoundedAndOutsideSaturates) {
    Volume image(plain_grid({2, 2, 2}), CV_8U);
    image.data<std::uint8_t>()[image.offset(1, 0, 0)] = 3;
    Geometry target = plain_grid({2, 1, 1}, {5, 1, 1});
    target.origin[0] = 0.6;  // 1.8 rounds to 2; the other lies outside
    const Volume result = resample(image, target, Interpolation::Linear, 1000.0);
    EXPECT_EQ(result.data<std::uint8_t>()[0], 2);
    EXPECT_EQ(result.data<std::uint8_t>()[1], 255);
}

TEST(Crop, KeepsVoxelsAndTheirPlaces) {
    const Volume image = test::random_volume(oblique_grid(), CV_16S);
    const Volume part = crop(image, {1, 2, 3}, {5, 8, 10});
    EXPECT_EQ(part.geometry.size, (std::array<int, 3>{4, 6, 7}));
    EXPECT_EQ(part.data<short>()[part.offset(2, 3, 4)], image.data<short>()[image.offset(3, 5, 7)]);
    EXPECT_LT((part.geometry.point({2, 3, 4}) - image.geometry.point({3, 5, 7})).norm(), 1e-12);
    EXPECT_THROW(crop(image, {0, 0, 0}, {8, 9, 11}), InvalidInput);
    EXPECT_THROW(crop(image, {2, 0, 0}, {2, 9, 11}), InvalidInput);
}

// --- distance and morphology

/// Points halfway along grid edges between a voxel of the mask and one outside, in mm along the axes.
std::vector<Eigen::Vector3d> crossings(const Volume& mask) {
    std::vector<Eigen::Vector3d> points;
    const auto in = [&](const Eigen::Vector3d& p) {
        return mask.data<std::uint8_t>()[mask.offset(int(p[0]), int(p[1]), int(p[2]))] != 0;
    };
    for (const Eigen::Vector3d& index : all_indices(mask.geometry))
        for (int axis = 0; axis < 3; ++axis) {
            const Eigen::Vector3d next = index + Eigen::Vector3d::Unit(axis);
            if (next[axis] < mask.geometry.size[std::size_t(axis)] && in(index) != in(next))
                points.push_back(mask.geometry.spacing.cwiseProduct(0.5 * (index + next)));
        }
    return points;
}

TEST(SignedDistance, AgreesWithBruteForceOnRandomAnisotropicMasks) {
    for (const int percent : {1, 20, 50, 97}) {
        Geometry grid = oblique_grid({20, 20, 20});
        const Volume mask = random_mask(grid, percent, static_cast<unsigned>(percent));
        const Volume distance = signed_distance(mask);
        const auto points = crossings(mask);
        std::size_t voxel = 0;
        for (const Eigen::Vector3d& index : all_indices(grid)) {
            double nearest = std::numeric_limits<double>::infinity();
            for (const Eigen::Vector3d& point : points)
                nearest = std::min(nearest, (grid.spacing.cwiseProduct(index) - point).squaredNorm());
            const double expected = std::sqrt(nearest) * (mask.data<std::uint8_t>()[voxel] ? -1 : 1);
            ASSERT_NEAR(distance.data<float>()[voxel], expected, 1e-5) << percent << " % voxel " << voxel;
            ++voxel;
        }
    }
}

TEST(SignedDistance, OfAHalfSpaceIsTheDistanceToThePlaneBetweenVoxels) {
    Volume mask(plain_grid({10, 4, 4}, {1.5, 1, 1}), CV_8U);
    for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j)
            for (int k = 0; k < 4; ++k) mask.data<std::uint8_t>()[mask.offset(i, j, k)] = 255;
    const Volume distance = signed_distance(mask);
    for (int i = 0; i < 10; ++i)
        EXPECT_FLOAT_EQ(distance.data<float>()[distance.offset(i, 2, 2)], 1.5F * (float(i) - 3.5F));
}

TEST(SignedDistance, OfABallIsItsClosedFormToHalfAVoxel) {
    const Geometry grid = plain_grid({61, 61, 31}, {1, 1, 2});
    Volume mask(grid, CV_8U);
    const Eigen::Vector3d centre = grid.point({30, 30, 15});
    std::size_t voxel = 0;
    for (const Eigen::Vector3d& index : all_indices(grid))
        mask.data<std::uint8_t>()[voxel++] = (grid.point(index) - centre).norm() < 20.0;
    const Volume distance = signed_distance(mask);
    voxel = 0;
    double sum = 0.0;
    for (const Eigen::Vector3d& index : all_indices(grid)) {
        const double error = distance.data<float>()[voxel++] - ((grid.point(index) - centre).norm() - 20.0);
        ASSERT_LE(std::abs(error), 1.0 + 1e-5);  // half the longest edge
        sum += error;
    }
    EXPECT_LT(std::abs(sum / static_cast<double>(grid.voxel_count())), 0.25);
}

TEST(SignedDistance, AMaskWithoutBoundaryIsRefused) {
    Volume mask(plain_grid({4, 4, 4}), CV_8U);
    EXPECT_THAT(test::message_of<InvalidInput>([&] { signed_distance(mask); }), testing::HasSubstr("empty"));
    mask.voxels.setTo(1);
    EXPECT_THAT(test::message_of<InvalidInput>([&] { signed_distance(mask); }), testing::HasSubstr("fills the image"));
}

Volume brute_force_dilation(const Volume& mask, double radius) {
    Volume result(mask.geometry, CV_8U);
    const auto indices = all_indices(mask.geometry);
    for (std::size_t a = 0; a < indices.size(); ++a)
        for (std::size_t b = 0; b < indices.size() && !result.data<std::uint8_t>()[a]; ++b)
            if (mask.data<std::uint8_t>()[b] &&
                mask.geometry.spacing.cwiseProduct(indices[a] - indices[b]).norm() <= radius + 1e-9)
                result.data<std::uint8_t>()[a] = 1;
    return result;
}

Volume complement(const Volume& mask) {
    Volume result = mask.clone();
    for (long long i = 0; i < mask.geometry.voxel_count(); ++i)
        result.data<std::uint8_t>()[i] = !mask.data<std::uint8_t>()[i];
    return result;
}

TEST(Morphology, AgreesWithBruteForce) {
    const Volume mask = random_mask(plain_grid({14, 13, 12}, {1.0, 1.5, 2.0}), 3, 5);
    for (const double radius : {0.0, 1.0, 2.5, 3.0}) {
        const Volume grown = brute_force_dilation(mask, radius);
        EXPECT_TRUE(test::same_voxels(dilate(mask, radius).voxels, grown.voxels)) << radius;
        const Volume shrunk = complement(brute_force_dilation(complement(grown), radius));
        EXPECT_TRUE(test::same_voxels(erode(grown, radius).voxels, shrunk.voxels)) << radius;
        EXPECT_TRUE(test::same_voxels(close(mask, radius).voxels, shrunk.voxels)) << radius;
    }
}

TEST(Morphology, AgreesWithBruteForceFarBeyondAVoxel) {
    const Volume mask = random_mask(plain_grid({40, 36, 5}, {0.1, 0.1, 0.25}), 1, 6);
    for (const double radius : {0.35, 1.55, 1.7})  // windows of 4 and 16 voxels, and wider ones than are taken
        EXPECT_TRUE(test::same_voxels(dilate(mask, radius).voxels, brute_force_dilation(mask, radius).voxels))
            << radius;
}

TEST(Morphology, OpeningRemovesWhatIsThinnerThanTheBall) {
    Volume mask(plain_grid({30, 30, 30}), CV_8U);
    for (int i = 0; i < 30; ++i) mask.data<std::uint8_t>()[mask.offset(i, 2, 2)] = 1;  // a wire
    for (int k = 10; k < 25; ++k)
        for (int j = 10; j < 25; ++j)
            for (int i = 10; i < 25; ++i) mask.data<std::uint8_t>()[mask.offset(i, j, k)] = 1;
    const Volume opened = open(mask, 2.0);
    EXPECT_EQ(opened.data<std::uint8_t>()[opened.offset(15, 2, 2)], 0);
    EXPECT_EQ(opened.data<std::uint8_t>()[opened.offset(17, 17, 10)], 1);  // a face of the block
    EXPECT_EQ(opened.data<std::uint8_t>()[opened.offset(10, 10, 10)], 0);  // its corner
}

TEST(Morphology, EmptyAndFullMasksStayWhatTheyAre) {
    Volume mask(plain_grid({5, 5, 5}), CV_8U);
    EXPECT_EQ(cv::sum(dilate(mask, 2.0).voxels)[0], 0.0);
    mask.voxels.setTo(1);
    EXPECT_EQ(cv::sum(erode(mask, 2.0).voxels)[0], 125.0);
    EXPECT_THROW(dilate(mask, -1.0), InvalidInput);
}

// --- the same bits for any number of threads

TEST(Filters, GiveTheSameBitsForOneThreadAndMany) {
    const Geometry grid = plain_grid({67, 61, 59}, {0.7, 1.0, 1.3});
    const Volume image = test::random_volume(grid, CV_32F), mask = random_mask(grid, 2, 9);
    const auto run = [&] {
        std::vector<Volume> results{smooth(image, 1.7), gradient(image), signed_distance(mask), dilate(mask, 2.1)};
        results.push_back(resample(image, oblique_grid({40, 40, 40}), Interpolation::Linear));
        return results;
    };
    const auto many = run();
    const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
    const auto one = run();
    for (std::size_t i = 0; i < many.size(); ++i) EXPECT_TRUE(test::same_voxels(many[i].voxels, one[i].voxels)) << i;
}

}  // namespace
}  // namespace tissuewarp::imaging
