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

TEST(Compounding, SixteenBitsGiveWhatEightGive) {
    const Sweep bytes = freehand(30, 0.5, 5);
    Sweep words = bytes;
    words.pixels = cv::Mat(3, bytes.pixels.size.p, CV_16U);
    for (int n = 0; n < 30; ++n)
        for (int r = 0; r < 80; ++r)
            for (int c = 0; c < 100; ++c)
                words.pixels.at<std::uint16_t>(n, r, c) =
                    static_cast<std::uint16_t>(200 * bytes.pixels.at<std::uint8_t>(n, r, c));
    const Volume of_bytes = compound(bytes).volume, of_words = compound(words).volume;
    ASSERT_EQ(of_words.voxels.depth(), CV_16U);
    ASSERT_EQ(of_words.geometry.size, of_bytes.geometry.size);
    for (std::int64_t n = 0; n < of_bytes.geometry.voxel_count(); ++n)
        ASSERT_NEAR(of_words.data<std::uint16_t>()[n], 200 * of_bytes.data<std::uint8_t>()[n], 101);
}

TEST(Compounding, BlackWithinTheFanIsSeen) {
    Sweep sweep = freehand(30, 0.5, 3);
    for (int n = 10; n < 20; ++n)
        for (int r = 30; r < 50; ++r)
            for (int c = 40; c < 60; ++c) sweep.pixels.at<std::uint8_t>(n, r, c) = 0;
    const Compounded made = compound(sweep, {.spacing_mm = 0.5});
    EXPECT_EQ(value_at(made.volume, sweep.frames[15].to_patient * Eigen::Vector3d(50, 40, 0)), 1);
}

TEST(Compounding, BetweenFramesIsALinearInterpolationAndInAGapNothing) {
    Sweep sweep = freehand(6, 1, 1);
    const std::array<double, 6> z{0, 2.9, 5.8, 9.8, 12.7, 15.6};  // 4 mm between the third and the fourth
    for (int n = 0; n < 6; ++n) {
        sweep.frames[static_cast<std::size_t>(n)].to_patient =
            Eigen::Translation3d(0, 0, z[static_cast<std::size_t>(n)]) * Eigen::Scaling(0.4, 0.4, 1.0);
        for (int r = 0; r < 80; ++r)
            for (int c = 0; c < 100; ++c)
                sweep.pixels.at<std::uint8_t>(n, r, c) =
                    cv::saturate_cast<std::uint8_t>(60 + 10 * z[static_cast<std::size_t>(n)]);
    }
    const Compounded made = compound(sweep, {.spacing_mm = 0.5, .largest_gap_mm = 3});
    EXPECT_EQ(made.gaps, 1);
    for (const double at : {0.5, 1.5, 4.0, 5.5, 10.0, 11.5, 15.0})
        EXPECT_NEAR(value_at(made.volume, {20, 16, at}), 60 + 10 * at, 1.5) << at;
    for (const double at : {6.5, 7.0, 8.0, 9.0}) EXPECT_EQ(value_at(made.volume, {20, 16, at}), 0) << at;
}

// What lies across the frames near the pivot of a probe that tilts is as sharp as the frames there are close.
TEST(Compounding, ATiltIsAsFineAsItsFramesAreAtEachDepth) {
    const double degree = EIGEN_PI / 180;
    const auto stripes = [](const Eigen::Vector3d& p) { return 128 + 60 * std::sin(p.x() * 1.571); };  // 4 mm wide
    Eigen::Affine3d in_plane = Eigen::Affine3d::Identity();  // columns along y, rows along z, the depth
    in_plane.linear() << 0, 0, 1, 0.5, 0, 0, 0, 0.5, 0;
    for (const double step_deg : {0.5, 1.0, 1.3}) {
        Sweep sweep;
        const std::array<int, 3> size{41, 300, 60};
        sweep.pixels = cv::Mat(3, size.data(), CV_8U, cv::Scalar(0));
        for (int n = 0; n < 41; ++n) {
            const Eigen::Affine3d pose =
                Eigen::AngleAxisd(step_deg * (n - 20) * degree, Eigen::Vector3d::UnitY()) * in_plane;
            sweep.frames.push_back({n, pose});
            for (int r = 24; r < 300; ++r)
                for (int c = 0; c < 60; ++c)
                    sweep.pixels.at<std::uint8_t>(n, r, c) =
                        cv::saturate_cast<std::uint8_t>(stripes(pose * Eigen::Vector3d(c, r, 0)));
        }
        const Volume volume = compound(sweep, {.spacing_mm = 0.5}).volume;
        double off = 0;
        int count = 0;
        for (double depth = 14; depth < 30; depth += 0.5)
            for (double angle = -8; angle < 8; angle += 0.7, ++count) {
                const Eigen::Vector3d place(depth * std::sin(angle * degree), 15, depth * std::cos(angle * degree));
                const Eigen::Vector3d index = volume.geometry.point_to_index() * (place - volume.geometry.origin);
                const Eigen::Vector3d voxel = volume.geometry.point(index.array().round().matrix());
                off += std::pow(value_at(volume, place) - stripes(voxel), 2);
            }
        EXPECT_LT(std::sqrt(off / count), 12) << step_deg;  // of 42
    }
}

TEST(Compounding, AFrameThatWasBlankedShowsNothingOfThePicture) {
    const double whole = compound(freehand(40, 0.5, 4), {.spacing_mm = 0.5}).seen_share;
    for (const bool left_out : {false, true}) {
        Sweep sweep = freehand(40, 0.5, 4);
        for (int r = 0; r < 80; ++r)
            for (int c = 0; c < 100; ++c) sweep.pixels.at<std::uint8_t>(3, r, c) = 0;
        if (left_out) sweep.frames.erase(sweep.frames.begin() + 3);
        EXPECT_NEAR(compound(sweep, {.spacing_mm = 0.5}).seen_share, whole, 0.02 * whole) << left_out;
    }
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
    for (SweepFrame& frame : still.frames)
        frame.to_patient = Eigen::AngleAxisd(0.5, Eigen::Vector3d(1, 2, 1).normalized()) * frame.to_patient;
    EXPECT_THROW(compound(still), InvalidInput);  // however it lies
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
