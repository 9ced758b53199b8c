#include "imaging/foreground.hpp"
#include "core/errors.hpp"
#include "test_volumes.hpp"

#include <gmock/gmock.h>

#include <numbers>
#include <random>

namespace tissuewarp::imaging {
namespace {

using test::message_of;
using testing::HasSubstr;

/// Grey values of a place relative to the centre of a grid of 40³ voxels, with noise.
template <class Grey>
Volume image_of(const Grey& grey, float noise = 0) {
    Volume image(test::oblique_grid({40, 40, 40}), CV_32F);
    std::mt19937 generator(3);
    std::normal_distribution<float> normal;
    for (int k = 0; k < 40; ++k)
        for (int j = 0; j < 40; ++j)
            for (int i = 0; i < 40; ++i)
                image.data<float>()[image.offset(i, j, k)] =
                    float(grey(Eigen::Vector3d(i, j, k) - Eigen::Vector3d::Constant(19.5))) + noise * normal(generator);
    return image;
}

constexpr double radius = 12;  // voxels

TEST(Foreground, IsTheBrightBodyWithItsDarkCore) {
    const Volume image = image_of(
        [](const Eigen::Vector3d& p) {
            const bool speck = (p - Eigen::Vector3d(17, 17, 17)).norm() < 2;
            return speck || (p.norm() < radius && p.norm() > 5) ? 100.0 : 10.0;
        },
        10);
    const Foreground found = foreground(image);
    const double ball = 4.0 / 3 * std::numbers::pi * radius * radius * radius * image.geometry.voxel_volume();
    EXPECT_NEAR(found.volume_mm3, ball, 0.05 * ball);
    EXPECT_NEAR(found.threshold, 55, 20);
    EXPECT_EQ(found.labels.data<int>()[found.labels.offset(20, 20, 20)], 1) << "the dark core is a hole";
    EXPECT_EQ(found.labels.data<int>()[found.labels.offset(36, 36, 36)], 0) << "the speck is another piece";
    EXPECT_NEAR(found.image_share, found.volume_mm3 / image.geometry.voxel_volume() / 64000, 1e-12);
}

TEST(Foreground, RefusesAnImageWithoutABody) {
    const auto refusal = [](const Volume& image) { return message_of<InvalidInput>([&] { (void)foreground(image); }); };
    EXPECT_THAT(refusal(image_of([](const Eigen::Vector3d&) { return 7.0; })), HasSubstr("is constant"));
    EXPECT_THAT(refusal(image_of([](const Eigen::Vector3d&) { return 100.0; }, 10)), HasSubstr("as noise does"));
    EXPECT_THAT(refusal(image_of([](const Eigen::Vector3d& p) { return p.norm() < 6 ? 10.0 : 100.0; })),
                HasSubstr("of the image is bright"));
}

TEST(Foreground, FillsWhatTheEdgeOfTheImageIsNotReachedFrom) {
    Volume mask(test::plain_grid({7, 7, 7}), CV_8U);
    for (int k = 1; k < 6; ++k)
        for (int j = 1; j < 6; ++j)
            for (int i = 1; i < 6; ++i) mask.data<std::uint8_t>()[mask.offset(i, j, k)] = i != 3 || j != 3 || k != 3;
    EXPECT_EQ(cv::countNonZero(without_holes(mask).voxels.reshape(1, 1)), 125);
    for (int i = 4; i < 7; ++i) mask.data<std::uint8_t>()[mask.offset(i, 3, 3)] = 0;  // a passage to the hole
    EXPECT_EQ(cv::countNonZero(without_holes(mask).voxels.reshape(1, 1)), 122);
}

}  // namespace
}  // namespace tissuewarp::imaging
