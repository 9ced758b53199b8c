/// Pairs of points as data, and what is expected of tissue that few data show.
#include "core/errors.hpp"
#include "registration/field.hpp"
#include "registration/springs/ground_springs.hpp"
#include "registration/terms/points.hpp"
#include "registration/uncertainty.hpp"
#include "registration/update.hpp"
#include "tests/registration/doubt_codes.hpp"
#include "tests/registration/shapes.hpp"
#include "tests/support/label_shapes.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/LU>

namespace tissuewarp::registration {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

PrepareOptions coarse() {
    PrepareOptions options;
    options.meshing.edge_length = 9;
    return options;
}

UpdateOptions on_cpu() {
    UpdateOptions options;
    options.device = Device::Cpu;
    return options;
}

/// A smooth bend of some mm that keeps volume to first order.
Vector3d bent(const Vector3d& x) {
    return x + Vector3d(0, 0, 0.002 * x[0] * x[0]);
}

const Eigen::Isometry3d away = test::motion(25, {1, 2, -1}, {30, -12, 18});

/// Points on a grid within the organ, and where they went.
PointPairs grid_pairs(double step) {
    std::vector<Vector3d> points;
    for (double x = -40; x <= 40; x += step)
        for (double y = -30; y <= 30; y += step)
            for (double z = -25; z <= 25; z += step)
                if (Vector3d(x / 43, y / 33, z / 28).norm() < 1) points.emplace_back(x, y, z);
    PointPairs pairs{Matrix3Xd(3, points.size()), Matrix3Xd(3, points.size()), 0.5};
    for (std::size_t n = 0; n < points.size(); ++n) {
        pairs.moving.col(static_cast<Eigen::Index>(n)) = points[n];
        pairs.fixed.col(static_cast<Eigen::Index>(n)) = away * bent(points[n]);
    }
    return pairs;
}

double mean_error(const UpdateResult& result, const PointPairs& truth) {
    return (PointTransform(result.deformation)(truth.moving) - truth.fixed).colwise().norm().mean();
}

// Pulls turned the wrong way, in the wrong frame, or without the wrong pairs weighed down leave 3 mm and more.
TEST(PointTerm, PairsCarryTheTissueAndWrongOnesDoNot) {
    const auto prepared = prepare(shapes::organ_labels({}), coarse());
    PointPairs pairs = grid_pairs(17);
    const Eigen::Index count = pairs.moving.cols();
    ASSERT_GT(count, 20);
    pairs.fixed.col(3) += Vector3d(25, -20, 10);
    pairs.fixed.col(count - 4) -= Vector3d(5, 30, 10);
    const UpdateResult result = update(prepared, {.points = pairs}, on_cpu());
    const PointPairs truth = grid_pairs(7);
    EXPECT_GT((away * truth.moving - truth.fixed).colwise().norm().maxCoeff(), 2.5);  // bent
    EXPECT_LT(mean_error(result, truth), 0.5);
    EXPECT_EQ(result.points->used, count);
    EXPECT_EQ(result.points->outliers, 2);
    EXPECT_LT(result.points->residual_mm, 0.5);
    EXPECT_TRUE(result.doubts.empty()) << result.doubts.front().text;
}

TEST(PointTerm, TwoPairsShiftTheOrganAndDoNotTurnIt) {
    const auto prepared = prepare(shapes::organ_labels({}), coarse());
    const Vector3d shift(20, -10, 5);
    PointPairs pairs{Matrix3Xd(3, 2), Matrix3Xd(3, 2), 1.0};
    pairs.moving << -10, 10, 0, 5, 0, 0;
    pairs.fixed = pairs.moving.colwise() + shift;
    const UpdateResult result = update(prepared, {.points = pairs}, on_cpu());
    const PointPairs places = grid_pairs(15);
    const Matrix3Xd moved = PointTransform(result.deformation)(places.moving);
    EXPECT_LT(((moved - places.moving).colwise() - shift).colwise().norm().maxCoeff(), 0.1);
    EXPECT_THAT(test::codes(result.doubts), testing::Contains("placement.turn_unknown"));
    EXPECT_GT(summarise(uncertainty(prepared, result)).failed_share, 0.3);  // two points say little of the rest
}

// Of pairs on a line nobody knows the turn about it, however many they are.
TEST(PointTerm, PairsOnALineDoNotTellTheTurnAboutIt) {
    const auto prepared = prepare(shapes::organ_labels({}), coarse());
    const auto failed_share = [&](int count, double off_the_line_mm) {
        PointPairs pairs{Matrix3Xd::Zero(3, count), Matrix3Xd::Zero(3, count), 1.0};
        for (int n = 0; n < count; ++n)
            pairs.moving.col(n) = Vector3d(-35 + 70.0 * n / (count - 1), off_the_line_mm * std::cos(2.0 * n),
                                           off_the_line_mm * std::sin(2.0 * n));
        pairs.fixed = pairs.moving.colwise() + Vector3d(3, -2, 4);
        return summarise(uncertainty(prepared, update(prepared, {.points = pairs}, on_cpu()))).failed_share;
    };
    for (const int count : {2, 3, 12}) EXPECT_GT(failed_share(count, 0), 0.3) << count;
    EXPECT_EQ(failed_share(12, 8), 0);
}

TEST(PointTerm, WrongPairsAmongFewAreSaid) {
    const auto prepared = prepare(shapes::organ_labels({}), coarse());
    PointPairs pairs = grid_pairs(20);
    for (Eigen::Index n = 0; n < pairs.fixed.cols(); n += 3) pairs.fixed.col(n)[n % 2] += n % 4 ? 20 : -25;
    EXPECT_THAT(test::codes(update(prepared, {.points = pairs}, on_cpu()).doubts),
                testing::Contains("points.outliers"));
}

TEST(PointTerm, WhatCannotBeUsedIsRefused) {
    const auto prepared = prepare(shapes::organ_labels({}), coarse());
    const PointPairs good = grid_pairs(25);
    std::vector<PointPairs> bad(5, good);
    bad[0].fixed(1, 2) = NAN;
    bad[1].deviation_mm = 0;
    bad[2].fixed = good.fixed.leftCols(2);
    bad[3].moving.colwise() += Vector3d(300, 0, 0);
    bad[4] = PointPairs{};
    for (const PointPairs& pairs : bad) EXPECT_THROW(update(prepared, {.points = pairs}, on_cpu()), InvalidInput);
}

}  // namespace
}  // namespace tissuewarp::registration
