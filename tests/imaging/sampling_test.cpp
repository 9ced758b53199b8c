#include "imaging/sampling.hpp"
#include "core/errors.hpp"
#include "imaging/filters.hpp"
#include "imaging/vector_sampling.hpp"
#include "test_volumes.hpp"

#include <limits>

namespace tissuewarp::imaging {
namespace {

using test::oblique_grid;

std::vector<Eigen::Vector3d> random_points(const Geometry& grid, double margin, int count) {
    std::mt19937 generator(3);
    std::uniform_real_distribution<double> uniform(0.0, 1.0);
    std::vector<Eigen::Vector3d> points;
    for (int n = 0; n < count; ++n) {
        Eigen::Vector3d index;
        for (std::size_t axis = 0; axis < 3; ++axis)
            index[axis] = -margin + uniform(generator) * (grid.size[axis] - 1 + 2 * margin);
        points.push_back(grid.point(index));
    }
    return points;
}

TEST(LinearSampler, IsExactForALinearFunctionAndItsGradient) {
    const Eigen::Vector3d slope(0.3, -0.7, 1.1);
    for (const bool left_handed : {false, true}) {
        Volume volume(oblique_grid({7, 9, 11}, left_handed), CV_32F);
        for (int k = 0; k < 11; ++k)
            for (int j = 0; j < 9; ++j)
                for (int i = 0; i < 7; ++i)
                    volume.data<float>()[volume.offset(i, j, k)] =
                        static_cast<float>(slope.dot(volume.geometry.point({1.0 * i, 1.0 * j, 1.0 * k})));
        const LinearSampler sampler(volume);
        for (const Eigen::Vector3d& point : random_points(volume.geometry, 0.0, 200)) {
            EXPECT_NEAR(sampler.value(point), slope.dot(point), 2e-5);
            const auto [value, gradient] = sampler.value_and_gradient(point);
            EXPECT_DOUBLE_EQ(value, sampler.value(point));
            EXPECT_LT((gradient - slope).norm(), 1e-4);
        }
    }
}

TEST(LinearSampler, GradientAgreesWithFiniteDifferences) {
    const Volume volume = test::random_volume(oblique_grid(), CV_32F);
    const LinearSampler sampler(volume);
    int checked = 0;
    for (const Eigen::Vector3d& point : random_points(volume.geometry, 0.0, 500)) {
        // Across a face of a cell the derivative jumps.
        const Eigen::Vector3d index = sampler.index(point);
        if ((index - index.array().round().matrix()).cwiseAbs().minCoeff() < 1e-3) continue;
        const Eigen::Vector3d gradient = sampler.value_and_gradient(point).gradient;
        for (int axis = 0; axis < 3; ++axis) {
            const Eigen::Vector3d step = 1e-4 * Eigen::Vector3d::Unit(axis);
            EXPECT_NEAR(gradient[axis], (sampler.value(point + step) - sampler.value(point - step)) / 2e-4, 2e-2);
        }
        ++checked;
    }
    EXPECT_GT(checked, 400);
}

TEST(LinearSampler, AgreesWithResample) {
    const Volume volume = test::random_volume(oblique_grid(), CV_32F);
    Geometry grid = test::plain_grid({6, 6, 6}, {0.5, 0.5, 0.5});
    grid.origin = volume.geometry.point({3, 4, 5});
    const Volume resampled = resample(volume, grid, Interpolation::Linear);
    const LinearSampler sampler(volume);
    for (int k = 0; k < 6; ++k)
        for (int j = 0; j < 6; ++j)
            for (int i = 0; i < 6; ++i) {
                const Eigen::Vector3d point = grid.point({1.0 * i, 1.0 * j, 1.0 * k});
                if (sampler.contains(point)) {
                    EXPECT_NEAR(resampled.data<float>()[resampled.offset(i, j, k)], sampler.value(point), 1e-4);
                }
            }
}

TEST(LinearSampler, ClampsAtTheBorderWithNoSlopeAcrossIt) {
    Volume volume(test::plain_grid({3, 3, 3}), CV_32F);
    for (int n = 0; n < 27; ++n) volume.data<float>()[n] = static_cast<float>(n % 3 + 10 * (n / 3 % 3));
    const LinearSampler sampler(volume);
    EXPECT_DOUBLE_EQ(sampler.value({-100, 1, 1}), 10.0);
    EXPECT_DOUBLE_EQ(sampler.value({100, 1, 1}), 12.0);
    EXPECT_EQ(sampler.value_and_gradient({-100, 1.5, 1}).gradient, Eigen::Vector3d(0, 10, 0));
    EXPECT_TRUE(sampler.contains({-0.4, 0, 2.4}));
    EXPECT_FALSE(sampler.contains({-0.6, 0, 0}));
}

TEST(LinearSampler, APointThatIsNotFiniteStaysInMemory) {
    const Volume volume = test::random_volume(test::plain_grid({3, 3, 3}), CV_32F);
    const LinearSampler sampler(volume);
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(sampler.contains({nan, 0, 0}));
    EXPECT_TRUE(std::isfinite(sampler.value({nan, 0, 0})));
}

TEST(LinearSampler, RefusesOtherTypesAndFlatVolumes) {
    EXPECT_THROW(LinearSampler(Volume(test::plain_grid({3, 3, 3}), CV_16S)), InvalidInput);
    EXPECT_THROW(LinearSampler(Volume(test::plain_grid({3, 3, 1}), CV_32F)), InvalidInput);
}

TEST(NearestValue, TakesTheVoxelThatHoldsThePoint) {
    const Volume labels = test::random_volume(oblique_grid(), CV_8U);
    EXPECT_EQ(nearest_value<std::uint8_t>(labels, labels.geometry.point({2.4, 3.6, 4.4})),
              labels.data<std::uint8_t>()[labels.offset(2, 4, 4)]);
    EXPECT_EQ(nearest_value<std::uint8_t>(labels, labels.geometry.point({-0.6, 3, 4}), 255), 255);
}

TEST(VectorSampler, AgreesWithTheScalarSamplerOnEachComponentAndBeyondTheBorder) {
    const Volume field = test::random_volume(oblique_grid(), CV_32FC3);
    std::array<cv::Mat, 3> parts;
    for (std::size_t c = 0; c < 3; ++c) {
        parts[c] = cv::Mat(3, field.voxels.size.p, CV_32FC1);
        for (std::int64_t n = 0; n < field.geometry.voxel_count(); ++n)
            parts[c].ptr<float>()[n] = field.data<cv::Vec3f>()[n][static_cast<int>(c)];
    }
    const VectorSampler sampler(field);
    for (const Eigen::Vector3d& point : random_points(field.geometry, 2.0, 300))
        for (std::size_t c = 0; c < 3; ++c) {
            const LinearSampler one(Volume(field.geometry, parts[c]));
            EXPECT_NEAR(sampler.value(point)[static_cast<int>(c)], one.value(point), 1e-4);
            EXPECT_EQ(sampler.contains(point), one.contains(point));
        }
    EXPECT_THROW(VectorSampler(Volume(field.geometry, CV_32FC1)), InvalidInput);
}

}  // namespace
}  // namespace tissuewarp::imaging
