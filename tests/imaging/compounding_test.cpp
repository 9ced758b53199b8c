/// Volumes of frames: against the function that the frames show, and what is not shown.
#include "imaging/compounding.hpp"
#include "core/errors.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace tissuewarp::imaging {
namespace {

double brightness(const Eigen::Vector3d& p) {
    return 120 + 40 * std::sin(p.x() / 6) + 30 * std::cos(p.y() / 5 + p.z() / 9);
}

/// A freehand sweep about the z axis: `step` mm a frame, swaying and turning, of pixels of 0.4 mm in a disc.
Sweep freehand(int frames, double step_mm, unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    Sweep sweep;
    const std::array<int, 3> size{frames, 80, 100};
    sweep.pixels = cv::Mat(3, size.data(), CV_8U, cv::Scalar(7));  // the scanner's picture about the disc
    double sway = 0;
    for (int n = 0; n < frames; ++n) {
        sway += 0.2 * normal(random);
        const Eigen::Affine3d pose = Eigen::Translation3d(-20 + sway, 10 - sway, step_mm * n) *
                                     Eigen::AngleAxisd(0.01 * sway, Eigen::Vector3d::UnitY()) *
                                     Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitX()) * Eigen::Scaling(0.4, 0.4, 1.0);
        sweep.frames.push_back({n, pose});
        for (int r = 0; r < 80; ++r)
            for (int c = 0; c < 100; ++c)
                if (std::hypot(c - 50, r - 40) < 38)
                    sweep.pixels.at<std::uint8_t>(n, r, c) =
                        cv::saturate_cast<std::uint8_t>(brightness(pose * Eigen::Vector3d(c, r, 0)));
    }
    return sweep;
}

/// Root mean square of what voxels differ from the function by, and how many show something.
std::pair<double, int> errors(const Volume& volume) {
    double sum = 0;
    int seen = 0;
    const auto [nx, ny, nz] = volume.geometry.size;
    for (int k = 0; k < nz; ++k)
        for (int j = 0; j < ny; ++j)
            for (int i = 0; i < nx; ++i) {
                const int value = volume.data<std::uint8_t>()[volume.offset(i, j, k)];
                if (value == 0) continue;
                sum += std::pow(value - brightness(volume.geometry.point({1.0 * i, 1.0 * j, 1.0 * k})), 2);
                ++seen;
            }
    return {std::sqrt(sum / seen), seen};
}

int value_at(const Volume& volume, const Eigen::Vector3d& place) {
    const Eigen::Vector3d index = volume.geometry.point_to_index() * (place - volume.geometry.origin);
    return volume.data<std::uint8_t>()[volume.offset(int(std::lround(index.x())), int(std::lround(index.y())),
                                                     int(std::lround(index.z())))];
}

TEST(Compounding, ShowsWhatTheFramesShow) {
    for (unsigned seed = 1; seed <= 4; ++seed) {
        const Compounded made = compound(freehand(60, 0.6, seed), {.spacing_mm = 0.7});
        const auto [error, seen] = errors(made.volume);
        EXPECT_LT(error, 1.5) << seed;  // of 70 grey values, rounding included
        EXPECT_NEAR(made.seen_share, double(seen) / double(made.volume.geometry.voxel_count()), 1e-12);
        // A cylinder of 76 pixels across, 35 mm long.
        EXPECT_NEAR(seen * std::pow(0.7, 3), 3.14 * std::pow(15.2, 2) * 35.4, 0.1 * 25700) << seed;
        EXPECT_EQ(made.gaps, 0);
        EXPECT_GT(made.median_step_mm, 0.5);
        EXPECT_LT(made.median_step_mm, 1.5);
    }
}

TEST(Compounding, LeavesTheScannersPictureAndWideGapsOut) {
    Sweep sweep = freehand(40, 0.5, 9);
    for (std::size_t n = 20; n < 40; ++n) sweep.frames[n].to_patient.pretranslate(Eigen::Vector3d(0, 0, 12));
    const Compounded made = compound(sweep, {.spacing_mm = 0.5, .largest_gap_mm = 3});
    EXPECT_EQ(made.gaps, 1);
    const Geometry& grid = made.volume.geometry;
    EXPECT_EQ(value_at(made.volume, sweep.frames[20].to_patient * Eigen::Vector3d(50, 40, -6)), 0);
    EXPECT_GT(value_at(made.volume, sweep.frames[20].to_patient * Eigen::Vector3d(50, 40, 1)), 1);
    for (std::int64_t n = 0; n < grid.voxel_count(); ++n) ASSERT_NE(made.volume.data<std::uint8_t>()[n], 7);
}

TEST(Compounding, BlackWithinTheFanIsSeen) {
    Sweep sweep = freehand(30, 0.5, 3);
    for (int n = 10; n < 20; ++n)
        for (int r = 30; r < 50; ++r)
            for (int c = 40; c < 60; ++c) sweep.pixels.at<std::uint8_t>(n, r, c) = 0;
    const Compounded made = compound(sweep, {.spacing_mm = 0.5});
    EXPECT_EQ(value_at(made.volume, sweep.frames[15].to_patient * Eigen::Vector3d(50, 40, 0)), 1);
}

TEST(Compounding, FramesMayLieNearlyAlongTheVoxels) {
    for (const double tilt : {0.0, 1e-14, 1e-11, 1e-9}) {
        Sweep sweep = freehand(20, 0.5, 2);
        for (int n = 0; n < 20; ++n)
            sweep.frames[static_cast<std::size_t>(n)].to_patient =
                Eigen::Translation3d(0, 0, 0.5 * n) * Eigen::AngleAxisd(tilt, Eigen::Vector3d(1, 1, 1).normalized()) *
                Eigen::Scaling(0.4, 0.4, 1.0);
        EXPECT_GT(compound(sweep).seen_share, 0.5) << tilt;
    }
}

TEST(Compounding, WhatIsNoSweepIsRefused) {
    Sweep still = freehand(5, 0.5, 1);
    for (SweepFrame& frame : still.frames) frame.to_patient = Eigen::Affine3d(Eigen::Scaling(0.4, 0.4, 1.0));
    EXPECT_THROW(compound(still), InvalidInput);  // all in one plane
    Sweep same = freehand(5, 0.5, 1);
    same.pixels.setTo(9);
    EXPECT_THROW(compound(same), InvalidInput);
    Sweep far = freehand(5, 0.5, 1);
    far.frames[2].to_patient.pretranslate(Eigen::Vector3d(1e5, 1e5, 1e5));
    EXPECT_THROW(compound(far), InvalidInput);
    EXPECT_THROW(compound(freehand(5, 0.5, 1), {.spacing_mm = 0}), InvalidInput);
}

}  // namespace
}  // namespace tissuewarp::imaging
