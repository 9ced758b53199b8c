/// Pairs of points as data, and what is expected of tissue that few data show.
#include "core/errors.hpp"
#include "registration/field.hpp"
#include "registration/springs/ground_springs.hpp"
#include "registration/terms/points.hpp"
#include "registration/uncertainty/expected_error.hpp"
#include "registration/update.hpp"
#include "tests/registration/shapes.hpp"
#include "tests/support/label_shapes.hpp"

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
    EXPECT_TRUE(doubt_of_data(expected_error(prepared, result)));  // two points say little of the rest
}

TEST(PointTerm, WrongPairsAmongFewAreSaid) {
    const auto prepared = prepare(shapes::organ_labels({}), coarse());
    PointPairs pairs = grid_pairs(20);
    for (Eigen::Index n = 0; n < pairs.fixed.cols(); n += 3) pairs.fixed.col(n)[n % 2] += n % 4 ? 20 : -25;
    const auto doubts = texts(update(prepared, {.points = pairs}, on_cpu()).doubts);
    ASSERT_FALSE(doubts.empty());
    EXPECT_NE(doubts.front().find("pairs of points"), std::string::npos) << doubts.front();
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

/// Twelve nodes, so that every one is looked at.
PreparedModel brick() {
    imaging::Volume labels(test::plain_grid({60, 40, 40}, 1.0, {-10, -10, -10}), CV_32SC1);
    test::for_each_voxel(labels, [&](const Vector3d& index, std::int64_t offset) {
        const Vector3d x = labels.geometry.point(index);
        labels.data<std::int32_t>()[offset] = (x.array() > 0).all() && x[0] < 40 && x[1] < 20 && x[2] < 20;
    });
    return prepare(meshing::box_mesh({40, 20, 20}, {2, 1, 1}), labels);
}

// The simple twin: the whole stiffness, and the whole ground less what it does to rigid motions, as dense matrices.
// With the wrong sign of the correction, or springs counted twice, the figures differ by tens of percent.
TEST(ExpectedError, IsThatOfTheDenseCovariance) {
    const PreparedModel prepared = brick();
    const int count = prepared.rest.node_count;
    ASSERT_LE(count, 16);
    detail::WeighedSprings springs;
    springs.energy = 300;
    springs.ground = detail::ground_springs(prepared, springs.energy, [](const InterfaceNode&) { return 7.0; });
    for (const int node : {0, 1, 4, 5})
        springs.data.push_back({node, Vector3d(20, 5, 60).asDiagonal(), Vector3d::Zero()});
    tled::Conditions all;
    all.springs = springs.data;
    all.springs.insert(all.springs.end(), springs.ground.begin(), springs.ground.end());
    const tled::RestStiffness stiffness(prepared.rest, tled::nodal_conditions(all, count));
    Eigen::MatrixXd inverse(3 * count, 3 * count), ground = Eigen::MatrixXd::Zero(3 * count, 3 * count);
    for (int k = 0; k < 3 * count; ++k) {
        Matrix3Xd force = Matrix3Xd::Zero(3, count);
        force.data()[k] = 1;
        const Matrix3Xd u = stiffness.solve(force);
        inverse.col(k) = Eigen::Map<const Eigen::VectorXd>(u.data(), 3 * count);
    }
    for (const tled::Spring& spring : springs.ground)
        ground.block<3, 3>(3 * spring.node, 3 * spring.node) += spring.stiffness;
    Eigen::MatrixXd motions(3 * count, 6);
    for (int n = 0; n < count; ++n)
        for (int axis = 0; axis < 3; ++axis) {
            motions.block<3, 1>(3 * n, axis) = Vector3d::Unit(axis);
            motions.block<3, 1>(3 * n, 3 + axis) =
                Vector3d::Unit(axis).cross(Vector3d(prepared.model.mesh.nodes.col(n)));
        }
    const Eigen::MatrixXd held = ground * motions;
    const Eigen::MatrixXd loose = inverse.inverse() - held * (motions.transpose() * held).inverse() * held.transpose();
    for (const bool free_placement : {false, true}) {
        springs.free_placement = free_placement;
        const Eigen::MatrixXd covariance = springs.energy * (free_placement ? loose.inverse().eval() : inverse);
        Eigen::VectorXd variances = Eigen::VectorXd::Zero(count);
        for (int k = 0; k < 3 * count; ++k) variances[k / 3] += covariance(k, k);
        const ExpectedError found =
            detail::expected_error(prepared.model.mesh.nodes, detail::Posterior(prepared, springs));
        EXPECT_NEAR(found.mean_mm / std::sqrt(variances.mean()), 1, 1e-6) << free_placement;
        Eigen::Index worst = 0;
        EXPECT_NEAR(found.worst_mm / std::sqrt(variances.maxCoeff(&worst)), 1, 1e-6) << free_placement;
        EXPECT_NEAR((found.worst_place - prepared.model.mesh.nodes.col(worst)).norm(), 0, 1e-9) << free_placement;
    }
}

}  // namespace
}  // namespace tissuewarp::registration
