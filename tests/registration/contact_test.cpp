/// Rigid neighbours that the organ does not enter, and tissue that stays.
#include "registration/terms/contact.hpp"
#include "core/errors.hpp"
#include "registration/prepared/prepared_io.hpp"
#include "registration/springs/ground_springs.hpp"
#include "registration/terms/anchors.hpp"
#include "registration/update.hpp"
#include "tests/registration/doubt_codes.hpp"
#include "tests/registration/shapes.hpp"
#include "tests/support/temporary_folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

namespace tissuewarp::registration {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;
using tissuewarp::test::TemporaryFolder;

constexpr int organ = 1, plate = 2, cap = 3;
constexpr double radius = 24, plate_top = -26.25;  // mm; between two slices of voxels

/// A ball of tissue above a thick plate, 2 mm apart; its top is another label. Voxels of 1.5 mm, LPS, a slice at z = 0.
imaging::Volume ball_on_plate() {
    imaging::Volume labels(test::plain_grid({54, 54, 50}, 1.5, {-40.5, -40.5, -45}), CV_32SC1);
    test::for_each_voxel(labels, [&](const Vector3d& index, std::int64_t n) {
        const Vector3d x = labels.geometry.point(index);
        int& label = labels.data<std::int32_t>()[n];
        if (x.norm() < radius) label = x[2] > 15 ? cap : organ;
        if (x[2] < plate_top) label = plate;
    });
    return labels;
}

PrepareOptions coarse(std::vector<int> neighbours, std::vector<int> anchors = {}) {
    PrepareOptions options;
    options.meshing.edge_length = 8;
    options.rigid_neighbours = std::move(neighbours);
    options.anchors = std::move(anchors);
    return options;
}

UpdateOptions on_cpu() {
    UpdateOptions options;
    options.device = Device::Cpu;
    options.align = false;
    return options;
}

/// Pairs all through the ball that say it moved by `shift`.
PointPairs shifted(const Vector3d& shift) {
    std::vector<Vector3d> points;
    for (double x = -20; x <= 20; x += 8)
        for (double y = -20; y <= 20; y += 8)
            for (double z = -20; z <= 20; z += 8)
                if (Vector3d(x, y, z).norm() < 20) points.emplace_back(x, y, z);
    PointPairs pairs{Matrix3Xd(3, points.size()), {}, 0.5};
    for (std::size_t n = 0; n < points.size(); ++n) pairs.moving.col(static_cast<Eigen::Index>(n)) = points[n];
    pairs.fixed = pairs.moving.colwise() + shift;
    return pairs;
}

const PreparedModel& ball_and_plate() {
    static const PreparedModel model = prepare(ball_on_plate(), coarse({plate}));
    return model;
}

double lowest(const UpdateResult& result) {
    return result.deformation.deformed_nodes().row(2).minCoeff();
}

TEST(Contact, ABallPressedAgainstAPlateDoesNotEnterIt) {
    const PointPairs pairs = shifted({0, 0, -8});
    const PreparedModel& with = ball_and_plate();
    const PreparedModel without = prepare(with.model.mesh, with.labels, coarse({}));
    EXPECT_LT(lowest(update(without, {.points = pairs}, on_cpu())), plate_top - 3);  // what would be without

    const UpdateResult result = update(with, {.points = pairs}, on_cpu());
    EXPECT_GT(lowest(result), plate_top - 0.05);
    EXPECT_LT(lowest(result), plate_top + 0.05);  // and it does not hover
    EXPECT_GT(result.contact->touching, 12);
    EXPECT_LT(result.contact->deepest_mm, 0.01);
    EXPECT_GT(result.min_jacobian, 0.76);
    const Matrix3Xd& u = result.deformation.displacement;
    EXPECT_LT(u.row(2).minCoeff(), -5.0);  // the top follows the data
}

// A tangential stiffness would hold what touches back by millimetres: beside the plate it must go as far as without.
TEST(Contact, WhatTouchesSlidesFreely) {
    const PreparedModel& model = ball_and_plate();
    const auto displacement = [&](const Vector3d& shift) {
        return update(model, {.points = shifted(shift)}, on_cpu()).deformation.displacement;
    };
    const Matrix3Xd pressed = displacement({0, 0, -5}), both = displacement({6, 0, -5}), slid = displacement({6, 0, 0});
    int touching = 0;
    for (Eigen::Index n = 0; n < both.cols(); ++n) {
        if (model.model.mesh.nodes(2, n) + both(2, n) > plate_top + 0.2) continue;
        EXPECT_NEAR(both(0, n) - pressed(0, n), slid(0, n), 0.3);
        ++touching;
    }
    EXPECT_GT(touching, 8);
}

TEST(Contact, SpringsPullAlongTheNormalAloneAndOnlyWhereTheOrganTouches) {
    const PreparedModel& model = ball_and_plate();
    detail::ContactTerm contact(model, detail::strain_energy_unit(model, {}));
    detail::State state{Eigen::Isometry3d::Identity(), Matrix3Xd::Zero(3, model.rest.node_count)};
    const detail::RoundPlan plan{0, false, 4, 1, 6, 0};
    EXPECT_FALSE(contact.follow(state));
    EXPECT_TRUE(contact.linearise(plan, state, silent_observer()).springs.empty());
    state.displacement.row(2).setConstant(-4);
    EXPECT_FALSE(contact.settled(state));
    UpdateResult judged;
    contact.judge(state, judged);
    EXPECT_NEAR(judged.contact->deepest_mm, 4 - (-radius - plate_top), 0.3);
    EXPECT_TRUE(contact.follow(state));
    const auto springs = contact.linearise(plan, state, silent_observer()).springs;
    ASSERT_FALSE(springs.empty());
    for (const auto& [spring, origin, shared, shows] : springs) {
        EXPECT_EQ(origin, Origin::Support);
        const Matrix3Xd& u = state.displacement;
        const Vector3d force = spring.stiffness * (spring.target - u.col(spring.node));
        EXPECT_GT(force[2], 0);
        EXPECT_LT(force.head<2>().norm(), 1e-3 * force[2]);
    }
    // Pulled away, nothing holds it.
    state.displacement.row(2).setConstant(1);
    EXPECT_FALSE(contact.follow(state));
    EXPECT_TRUE(contact.linearise(plan, state, silent_observer()).springs.empty());
    EXPECT_TRUE(contact.settled(state));
}

TEST(Contact, TheOrganComesOffWhenPulledAway) {
    const UpdateResult result = update(ball_and_plate(), {.points = shifted({0, 0, 6})}, on_cpu());
    EXPECT_EQ(result.contact->touching, 0);
    EXPECT_NEAR(lowest(result), -radius + 6, 0.1);
}

// Voxels leave an organ that lies on bone a fraction of a voxel within it; a contact that does not know this pushes.
TEST(Contact, AnOrganThatLiesOnItsNeighbourAndDidNotMoveIsNotMoved) {
    imaging::Volume labels = ball_on_plate();
    test::for_each_voxel(labels, [&](const Vector3d& index, std::int64_t n) {
        int& label = labels.data<std::int32_t>()[n];
        const Vector3d x = labels.geometry.point(index);
        if (label == 0 && x[2] < -12) label = plate;  // a hollow that fits the ball
    });
    const PreparedModel model = prepare(labels, coarse({plate}));
    const UpdateResult result = update(model, {.labels = labels}, on_cpu());
    EXPECT_LT(result.deformation.displacement.colwise().norm().maxCoeff(), 0.01);
    EXPECT_TRUE(result.doubts.empty()) << result.doubts.front().text;
}

TEST(Contact, AnOrganThatEnteredItsNeighbourIsDoubted) {
    const PreparedModel model = prepare(ball_on_plate(), coarse({plate}));
    detail::ContactTerm term(model, detail::strain_energy_unit(model, {}));
    const auto said = [&](double down_mm) {
        UpdateResult result;
        term.judge({Eigen::Isometry3d::Identity(), Vector3d(0, 0, -down_mm).replicate(1, model.rest.node_count)},
                   result);
        return test::codes(result.doubts);
    };
    EXPECT_THAT(said(2), testing::IsEmpty());
    EXPECT_THAT(said(4), testing::ElementsAre("contact.entered"));
}

TEST(Contact, SameBitsForOneThreadAndMany) {
    const auto solve = [&](std::size_t threads) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        return update(prepare(ball_on_plate(), coarse({plate}, {cap})), {.points = shifted({2, 0, -6})}, on_cpu());
    };
    EXPECT_EQ(solve(1).deformation.displacement, solve(2).deformation.displacement);
}

TEST(Anchors, HoldTheirTissueWhileTheRestFollowsTheData) {
    const PreparedModel model = prepare(ball_on_plate(), coarse({plate}, {cap}));
    const UpdateResult result = update(model, {.points = shifted({4, 0, 0})}, on_cpu());
    EXPECT_GT(result.anchors->nodes, 73);
    EXPECT_LT(result.anchors->largest_mm, 0.031);
    for (const int node : detail::anchored_nodes(model)) EXPECT_GT(model.model.mesh.nodes(2, node), 13.0);
    for (int node = 0; node < model.rest.node_count; ++node)
        if (model.model.mesh.nodes(2, node) < -10) {
            EXPECT_GT(result.deformation.displacement(0, node), 3.0);
        }
    const UpdateResult free = update(ball_and_plate(), {.points = shifted({4, 0, 0})}, on_cpu());
    for (const int node : detail::anchored_nodes(model)) EXPECT_GT(free.deformation.displacement(0, node), 2.5);
}

// With a free placement the whole organ would carry its anchors away and call that no displacement.
TEST(Anchors, KeepThePlacementWhereAlignmentFoundIt) {
    const PreparedModel model = prepare(ball_on_plate(), coarse({plate}, {cap}));
    UpdateOptions options = on_cpu();
    options.align = true;
    PointPairs pairs = shifted({0, 0, 0});
    const Eigen::Isometry3d motion = test::motion(20, {1, 1, 0}, {30, -10, 5});
    pairs.fixed = motion * pairs.moving;
    const UpdateResult result = update(model, {.points = pairs}, options);
    EXPECT_LT((result.deformation.placement.matrix() - motion.matrix()).norm(), 1e-6);
    EXPECT_LT(result.deformation.displacement.colwise().norm().maxCoeff(), 1e-6);
}

TEST(Surroundings, AreNotMeshedAndComeBackFromAFile) {
    const PreparedModel model = prepare(ball_on_plate(), coarse({plate}, {cap}));
    EXPECT_TRUE((model.model.mesh.labels.array() != plate).all());
    EXPECT_GT(model.model.mesh.nodes.row(2).minCoeff(), -25.5);
    const TemporaryFolder folder;
    write_prepared(model, folder / "surroundings.h5");
    const PreparedModel back = read_prepared(folder / "surroundings.h5");
    EXPECT_EQ(back.options.anchors, model.options.anchors);
    EXPECT_EQ(back.options.rigid_neighbours, model.options.rigid_neighbours);
    EXPECT_EQ(cv::norm(back.neighbours->distance.voxels, model.neighbours->distance.voxels, cv::NORM_INF), 0.0);
    EXPECT_EQ(cv::norm(back.labels.voxels, model.labels.voxels, cv::NORM_INF), 0.0);
}

TEST(Surroundings, ThatCannotBeAreRefused) {
    const imaging::Volume labels = ball_on_plate();
    const auto refuse = [&](std::vector<int> neighbours, std::vector<int> anchors, const char* words) {
        EXPECT_THAT([&] { (void)prepare(labels, coarse(neighbours, anchors)); },
                    ThrowsMessage<InvalidInput>(HasSubstr(words)));
    };
    refuse({9}, {}, "rigid neighbours: label 9 is absent; present are 1, 2, 3");
    refuse({}, {8}, "anchors: label 8 is absent; present are 1, 2, 3");
    refuse({0}, {}, "label 0");
    refuse({2}, {2}, "both as anchor and as rigid neighbour");
    refuse({1, 2, 3}, {}, "nothing is left");
    refuse({2}, {1, 3}, "nothing is left");
}

}  // namespace
}  // namespace tissuewarp::registration
