/// Which of several poses is taken where more than one explains the data.
#include "registration/pose/rival_poses.hpp"

#include "tests/support/label_shapes.hpp"
#include "tests/support/noted.hpp"

#include <gtest/gtest.h>

namespace tissuewarp::registration::detail {
namespace {

Eigen::Matrix3Xd corners() {
    Eigen::Matrix3Xd places(3, 4);
    places << 0, 60, 0, 0, 0, 0, 40, 0, 0, 0, 0, 30;
    return places;
}

FoundPose shifted(double mm, double cost) {
    FoundPose pose;
    pose.placement.translation()[0] = mm;
    pose.cost = cost;
    return pose;
}

TEST(RivalPoses, OfThoseThatFitAlikeTheNearestToTheStartIsTaken) {
    const std::vector<FoundPose> found{shifted(30, 0.10), shifted(12, 0.12), shifted(-40, 0.11), shifted(2, 0.5)};
    const ChosenPose pose = choose_pose(found, corners(), Eigen::Isometry3d::Identity());
    EXPECT_EQ(pose.chosen.placement.translation()[0], 12);
    EXPECT_EQ(pose.rival_cost, 0.10);
    EXPECT_EQ(pose.rival_mm, 18);
    EXPECT_NEAR(pose.rival_support(), 0.9 / 0.88, 1e-12);
    const Eigen::Isometry3d far(Eigen::Translation3d(40, 0, 0));
    EXPECT_EQ(choose_pose(found, corners(), far).chosen.placement.translation()[0], 30);
}

TEST(RivalPoses, ThatFitWorseDoNotWinByBeingNear) {
    const std::vector<FoundPose> found{shifted(80, 0.10), shifted(0, 0.16)};
    EXPECT_EQ(choose_pose(found, corners(), Eigen::Isometry3d::Identity()).chosen.placement.translation()[0], 80);
    EXPECT_EQ(choose_pose({shifted(5, 0.3)}, corners(), Eigen::Isometry3d::Identity()).rival_cost, 1);
}

// Navigation that placed the organ to a centimetre has told apart what lies a decimetre from there.
TEST(RivalPoses, AreNoneWhereTheHeadersTellThemApart) {
    const auto chosen_beside = [](double rival_shift) {
        return choose_pose({shifted(10, 0.10), shifted(rival_shift, 0.10)}, corners(), Eigen::Isometry3d::Identity());
    };
    EXPECT_EQ(chosen_beside(29).rival_mm, 19);
    EXPECT_EQ(chosen_beside(31).rival_mm, 0);
    EXPECT_EQ(chosen_beside(31).rival_cost, 1);
    EXPECT_EQ(chosen_beside(31).ruled_out_mm, 21);
    EXPECT_EQ(chosen_beside(29).ruled_out_mm, 0);
    const std::vector<FoundPose> all_far{shifted(80, 0.10), shifted(-120, 0.10)};
    EXPECT_EQ(choose_pose(all_far, corners(), Eigen::Isometry3d::Identity()).rival_mm, 200) << "headers tell nothing";
    const std::vector<FoundPose> both_near{shifted(1, 0.10), shifted(-20, 0.10)};
    EXPECT_EQ(choose_pose(both_near, corners(), Eigen::Isometry3d::Identity()).rival_mm, 21) << "they err by some mm";
}

TEST(RivalPoses, ThatOnlyHeadersRuleOutAreTold) {
    tissuewarp::test::Noted observer;
    tell_what_headers_decide({}, "the points", observer);
    EXPECT_EQ(observer.notes, "");
    tell_what_headers_decide({{}, 1, 0, 80.4}, "the points", observer);
    EXPECT_NE(observer.notes.find("the points fit about as well with the organ placed 80 mm elsewhere"),
              std::string::npos);
}

// A descent that stopped early is nearer to its start than one that arrived; both are one pose.
TEST(RivalPoses, OfNearlyTheSameTheBestCounts) {
    const std::vector<FoundPose> found{shifted(4, 0.13), shifted(10, 0.10)};
    const ChosenPose pose = choose_pose(found, corners(), Eigen::Isometry3d::Identity());
    EXPECT_EQ(pose.chosen.placement.translation()[0], 10);
    EXPECT_EQ(pose.rival_mm, 0);
    EXPECT_EQ(distinct_poses(found, corners(), 5).size(), 1U);
}

}  // namespace
}  // namespace tissuewarp::registration::detail
