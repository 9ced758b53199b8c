/// Whether regions of blocks are heard that say something in common, and single ones are not.
#include "registration/terms/left_behind.hpp"

#include <gtest/gtest.h>

#include <random>

namespace tissuewarp::registration::detail {
namespace {

constexpr int neighbours = 24;
constexpr double percent = 98, side_mm = 60, spacing_mm = 5;

/// Blocks on a grid that err by 1.5 mm each, found `common` beyond the tissue where x and y are below a quarter of the
/// side, a sixteenth of them; of the others none.
LeftBehind left_by(const Eigen::Vector3d& common) {
    std::mt19937 random(1);
    std::normal_distribution<double> error(0, 1.5);
    std::vector<BlockMatch> matches;
    std::vector<Eigen::Vector3d> went;
    for (double x = 0; x < side_mm; x += spacing_mm)
        for (double y = 0; y < side_mm; y += spacing_mm)
            for (double z = 0; z < side_mm; z += spacing_mm) {
                BlockMatch match;
                match.moving = {x, y, z};
                match.confidence = 0.5;
                went.push_back(match.moving + Eigen::Vector3d(30, 0, 0));
                match.fixed = went.back() + Eigen::Vector3d(error(random), error(random), error(random));
                if (x < side_mm / 4 && y < side_mm / 4) match.fixed += common;
                matches.push_back(match);
            }
    return left_behind(matches, went, neighbours, percent);
}

TEST(LeftBehind, SingleErrorsOfBlocksAreNotHeard) {
    EXPECT_LT(left_by(Eigen::Vector3d::Zero()).distance_mm, 1.5);
}

TEST(LeftBehind, WhatARegionSaysInCommonIsAndWhere) {
    const LeftBehind left = left_by({0, 4, 3});
    EXPECT_NEAR(left.distance_mm, 5, 1.5);
    EXPECT_LT(left.place.x(), side_mm / 4);
    EXPECT_LT(left.place.y(), side_mm / 4);
}

TEST(LeftBehind, FewBlocksSayNothing) {
    EXPECT_EQ(left_behind({}, {}, neighbours, percent).distance_mm, 0);
    const std::vector<BlockMatch> matches(neighbours - 1);
    const std::vector<Eigen::Vector3d> went(matches.size(), Eigen::Vector3d(9, 9, 9));
    EXPECT_EQ(left_behind(matches, went, neighbours, percent).distance_mm, 0);
}

}  // namespace
}  // namespace tissuewarp::registration::detail
