#include "simulation/curve.hpp"

#include "core/errors.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace tissuewarp::simulation {
namespace {

TEST(Curves, WithoutPointsRiseOverTheScene) {
    EXPECT_EQ(value_at({}, -1, 2), 0);
    EXPECT_EQ(value_at({}, 0.5, 2), 0.25);
    EXPECT_EQ(value_at({}, 3, 2), 1);
    EXPECT_EQ(steepest({}, 2), 0.5);
}

TEST(Curves, AreLinearBetweenPointsAndConstantBeyond) {
    const Curve curve{{{1, 0.5}, {2, 1}, {4, -1}}};
    EXPECT_EQ(value_at(curve, 0, 5), 0.5);
    EXPECT_EQ(value_at(curve, 1, 5), 0.5);
    EXPECT_EQ(value_at(curve, 1.5, 5), 0.75);
    EXPECT_EQ(value_at(curve, 3, 5), 0);
    EXPECT_EQ(value_at(curve, 4, 5), -1);
    EXPECT_EQ(value_at(curve, 9, 5), -1);
    EXPECT_EQ(steepest(curve, 5), 1);
    EXPECT_EQ(slope_before(curve, 1, 5), 0);
    EXPECT_EQ(slope_before(curve, 1.5, 5), 0.5);
    EXPECT_EQ(slope_before(curve, 2, 5), 0.5);
    EXPECT_EQ(slope_before(curve, 4, 5), -1);
    EXPECT_EQ(slope_before(curve, 4.5, 5), 0);
    EXPECT_EQ(slope_before({}, 1, 5), 0.2);
    EXPECT_EQ(slope_before({}, 0, 5), 0);
    EXPECT_EQ(steepest(curve, 1.5), 0.5) << "what lies after the scene does not count";
}

TEST(Curves, RefuseTimesThatGoBack) {
    EXPECT_THROW(require_valid(Curve{{{1, 0}, {1, 1}}}, "a curve"), InvalidInput);
    EXPECT_THROW(require_valid(Curve{{{1, 0}, {0, 1}}}, "a curve"), InvalidInput);
    EXPECT_THROW(require_valid(Curve{{{1, std::numeric_limits<double>::quiet_NaN()}}}, "a curve"), InvalidInput);
    EXPECT_NO_THROW(require_valid(Curve{{{0, 0}, {1, 1}}}, "a curve"));
}

}  // namespace
}  // namespace tissuewarp::simulation
