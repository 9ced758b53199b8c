/// What names stand for, and what pairs of points are.
#include "server/scene.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tissuewarp::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

PolyData patch() {
    PolyData mesh;
    mesh.points = Eigen::Matrix3Xd::Random(3, 10);
    mesh.normals.resize(3, 0);
    return mesh;
}

TEST(Scene, NamesInAnySpelling) {
    Scene scene;
    scene.take("Fixed Surface", patch());
    scene.take("fixed-points", NamedPoints{{"a", "", {1, 2, 3}}});
    EXPECT_EQ(scene.state(), 2);
    EXPECT_THAT(scene.data(), ElementsAre("fixed_surface", "fixed_points"));
}

TEST(Scene, NamesThatStandForNothing) {
    Scene scene;
    EXPECT_THAT([&] { scene.take("liver", patch()); }, ThrowsMessage<InvalidInput>(HasSubstr("fixed_surface")));
    EXPECT_THROW(scene.take("fixed_surface", NamedPoints{}), InvalidInput);
    EXPECT_EQ(scene.state(), 0);
}

TEST(Scene, PairsShareAName) {
    Scene scene;
    scene.take("moving_points", NamedPoints{{"b", "", {2, 0, 0}}, {"a", "", {1, 0, 0}}, {"c", "", {9, 9, 9}}});
    scene.take("fixed_points", NamedPoints{{"a", "", {1, 1, 0}}, {"b", "", {2, 1, 0}}, {"d", "", {7, 7, 7}}});
    const registration::Intraoperative seen = scene.seen({}, {.points_mm = 0.5});
    ASSERT_TRUE(seen.points);
    ASSERT_EQ(seen.points->moving.cols(), 2);
    EXPECT_EQ(seen.points->moving.col(0), Eigen::Vector3d(1, 0, 0));
    EXPECT_EQ(seen.points->fixed.col(1), Eigen::Vector3d(2, 1, 0));
    EXPECT_EQ(seen.points->deviation_mm, 0.5);
}

TEST(Scene, PairsWithoutACommonNameOrWithADoubleOne) {
    Scene scene;
    scene.take("moving_points", NamedPoints{{"a", "", {1, 0, 0}}, {"a", "", {2, 0, 0}}});
    scene.take("fixed_points", NamedPoints{{"a", "", {1, 1, 0}}});
    EXPECT_THAT([&] { return scene.seen({}, {}); }, ThrowsMessage<InvalidInput>(HasSubstr("called 'a'")));
    scene.take("moving_points", NamedPoints{{"b", "", {1, 0, 0}}});
    EXPECT_THAT([&] { return scene.seen({}, {}); }, ThrowsMessage<InvalidInput>(HasSubstr("share no name")));
}

TEST(Scene, TheNextTakesThePlaceOfTheLast) {
    Scene scene;
    scene.take("fixed_surface", patch());
    PolyData other = patch();
    other.points.array() += 5;
    scene.take("fixed_surface", other);
    EXPECT_EQ(scene.seen({}, {}).surface->points, other.points);
    scene.take("fixed_surface", PolyData{Eigen::Matrix3Xd(3, 0), Eigen::Matrix3Xd(3, 0), {}, {}, {}});
    EXPECT_TRUE(scene.data().empty());
}

TEST(Scene, OnlyWhatIsToBeUsed) {
    Scene scene;
    scene.take("fixed_surface", patch());
    scene.take("moving_points", NamedPoints{{"a", "", {1, 0, 0}}});
    scene.take("fixed_points", NamedPoints{{"a", "", {1, 1, 0}}});
    EXPECT_FALSE(scene.seen({"fixed_points"}, {}).surface);
    EXPECT_THAT([&] { return scene.seen({"fixed"}, {}); },
                ThrowsMessage<InvalidInput>(HasSubstr("'fixed' was not sent")));
    scene.forget("fixed_points");
    EXPECT_THAT(scene.data(), ElementsAre("fixed_surface"));
    EXPECT_THROW(scene.forget("liver"), InvalidInput);
}

Eigen::Isometry3d tip(double x, double y = 0, double z = 0) {
    return Eigen::Isometry3d(Eigen::Translation3d(x, y, z));
}

NamedPoints named(const std::vector<std::pair<std::string, double>>& points) {
    NamedPoints list;
    for (const auto& [name, x] : points) list.push_back({name, "", {x, 0, 0}});
    return list;
}

TEST(Scene, AStylusGathersAPatchWhileItIsAskedTo) {
    Scene scene;
    EXPECT_THROW(scene.take("stylus", tip(1)), InvalidInput) << "nobody listens to it";
    scene.gather({.device = "stylus", .id = "", .spacing_mm = 0.95});
    for (int n = 0; n <= 40; ++n) scene.take("Stylus", tip(0.1 * n));
    EXPECT_THAT(scene.data(), ElementsAre("touched"));
    const Eigen::Matrix3Xd points = scene.seen({}, {.surface_mm = 0.4}).surface->points;
    EXPECT_EQ(points.cols(), 5) << "0, 1, 2, 3 and 4 mm";
    EXPECT_EQ(scene.state(), 5) << "what says nothing new changes nothing";
    EXPECT_EQ(scene.seen({}, {.surface_mm = 0.4}).surface->deviation_mm, 0.4);
    scene.gather({});
    EXPECT_THROW(scene.take("stylus", tip(9)), InvalidInput);
    EXPECT_THROW(scene.gather({.device = "start"}), InvalidInput);
}

TEST(Scene, AStylusRenewsWhatItTouchesAgain) {
    Scene scene;
    scene.gather({.device = "stylus", .id = "", .spacing_mm = 1});
    scene.take("stylus", tip(0), 100);
    scene.take("stylus", tip(5), 100.1);
    scene.take("stylus", tip(0, 0.5), 100.9);
    EXPECT_EQ(scene.state(), 2) << "within a second it rests";
    scene.take("stylus", tip(0, 0.5), 102);
    const Eigen::Matrix3Xd points = scene.seen({}, {}).surface->points;
    ASSERT_EQ(points.cols(), 2);
    EXPECT_EQ(points.col(0), Eigen::Vector3d(5, 0, 0));
    EXPECT_EQ(points.col(1), Eigen::Vector3d(0, 0.5, 0)) << "the tissue has moved there";
}

TEST(Scene, OldTouchesFadeWhereThatIsAskedFor) {
    Scene scene;
    scene.gather({.device = "stylus", .id = "", .spacing_mm = 1, .keep_s = 10});
    EXPECT_THAT([&] { scene.take("stylus", tip(0)); }, ThrowsMessage<InvalidInput>(HasSubstr("keep_s")));
    for (int n = 0; n <= 20; ++n) scene.take("stylus", tip(2 * n), 1000 + n);
    const Eigen::Matrix3Xd points = scene.seen({}, {}).surface->points;
    ASSERT_EQ(points.cols(), 11);
    EXPECT_EQ(points.row(0).minCoeff(), 20);
    scene.take("touched", named({{"of no time", 300}}));
    scene.take("stylus", tip(0), 2000);
    EXPECT_EQ(scene.touched().size(), 2) << "what says no time stays until it is withdrawn";
}

TEST(Scene, TouchesAreMovedAndWithdrawnById) {
    Scene scene;
    scene.take("touched", named({{"a", 1}, {"b", 2}}));
    scene.take("touched", named({{"c", 3}, {"a", 7}}));
    Eigen::Matrix3Xd expected = Eigen::Matrix3Xd::Zero(3, 3);
    expected.row(0) << 7, 2, 3;
    EXPECT_EQ(scene.seen({}, {}).surface->points, expected);
    EXPECT_THAT([&] { scene.forget_touched({"a", "x"}); }, ThrowsMessage<InvalidInput>(HasSubstr("'x'")));
    EXPECT_EQ(scene.touched().size(), 3) << "one that is not there leaves all";
    scene.forget_touched({"a", "b"});
    EXPECT_EQ(scene.touched().points(), Eigen::Vector3d(3, 0, 0));
    EXPECT_THROW(scene.take("touched", named({{"d", 1}, {"d", 2}})), InvalidInput);
    EXPECT_THROW(scene.take("touched", named({{"", 1}})), InvalidInput);
    EXPECT_EQ(scene.touched().size(), 1);
    scene.take("touched", NamedPoints{});
    EXPECT_TRUE(scene.data().empty());
}

TEST(Scene, AStrokeIsWithdrawnAsAWhole) {
    Scene scene;
    scene.gather({.device = "stylus", .id = "left", .spacing_mm = 1});
    for (int n = 0; n < 5; ++n) scene.take("stylus", tip(2 * n));
    scene.gather({.device = "stylus", .id = "right", .spacing_mm = 1});
    for (int n = 0; n < 3; ++n) scene.take("stylus", tip(2 * n, 50));
    scene.forget_touched({"left"});
    EXPECT_EQ(scene.touched().size(), 3);
    EXPECT_EQ(scene.touched().points().row(1).minCoeff(), 50);
}

TEST(Scene, APatchAndTouchesAreOneSurface) {
    Scene scene;
    PolyData mesh = patch();
    mesh.normals = mesh.points.colwise().normalized();
    scene.take("fixed_surface", mesh);
    scene.take("touched", named({{"a", 1}, {"b", 2}}));
    const registration::Intraoperative both = scene.seen({}, {});
    EXPECT_EQ(both.surface->points.cols(), 12);
    EXPECT_EQ(both.surface->points.leftCols(10), mesh.points);
    EXPECT_EQ(both.surface->normals.cols(), 0) << "touches have none";
    EXPECT_EQ(scene.seen({"fixed_surface"}, {}).surface->normals, mesh.normals);
    EXPECT_EQ(scene.seen({"touched"}, {}).surface->points.cols(), 2);
}

TEST(Scene, APatchOfTouchesHasALimit) {
    Scene scene;
    NamedPoints many;
    for (int n = 0; n < 100'000; ++n) many.push_back({std::to_string(n), "", {0.1 * n, 0, 0}});
    scene.take("touched", many);
    EXPECT_THAT(
        [&] {
            scene.take("touched", named({{"one more", 1}}));
        },
        ThrowsMessage<InvalidInput>(HasSubstr("100 000")));
    scene.take("touched", named({{"7", 1}}));
    scene.gather({.device = "stylus", .id = "", .spacing_mm = 1});
    EXPECT_THROW(scene.take("stylus", tip(0, 500)), InvalidInput);
    EXPECT_EQ(scene.touched().size(), 100'000);
}

}  // namespace
}  // namespace tissuewarp::server
