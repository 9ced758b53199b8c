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

}  // namespace
}  // namespace tissuewarp::server
