/// Bones beside an organ that moved each on its own, as fixed labels show them.
#include "registration/evaluation.hpp"
#include "registration/field.hpp"
#include "registration/field/held_bodies.hpp"
#include "registration/pose/seen_bodies.hpp"
#include "registration/springs/ground_springs.hpp"
#include "registration/terms/contact.hpp"
#include "registration/update.hpp"
#include "tests/registration/shapes.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tissuewarp::registration {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr int organ = 1, left = 2, right = 3;
constexpr double radius = 22;  // mm

struct Bone {
    int label;
    Vector3d centre, half;
    Isometry3d motion = Isometry3d::Identity();

    /// An ellipsoid with a keel, so that every turn of it shows.
    [[nodiscard]] bool holds(const Vector3d& x) const {
        const Eigen::Array3d at = (x - centre).array() / half.array();
        return at.square().sum() < 1 || (std::abs(at[0]) < 0.25 && std::abs(at[1]) < 1.3 && std::abs(at[2]) < 0.5);
    }
};

Isometry3d about(const Vector3d& centre, double degrees, const Vector3d& axis, const Vector3d& shift) {
    return Eigen::Translation3d(centre) * test::motion(degrees, axis, shift) * Eigen::Translation3d(-centre);
}

/// Two bones below a ball. One comes up and turns, the other leans away.
std::vector<Bone> bones() {
    const Vector3d a(-17, 0, -37), b(17, 0, -37);
    return {{left, a, {13, 15, 12}, about(a, 8, {0.2, 1, 0}, {0, -1, 4})},
            {right, b, {13, 15, 12}, about(b, -6, {1, 0, 0.3}, {3, 0, -2})}};
}

imaging::Geometry room() {
    return test::plain_grid({64, 56, 60}, 1.5, {-48, -42, -60});
}

/// The map after bones moved (or before); the ball stays but for where a bone went.
imaging::Volume map_of(const std::vector<Bone>& all, bool moved, const imaging::Geometry& grid = room()) {
    imaging::Volume labels(grid, CV_32SC1);
    test::for_each_voxel(labels, [&](const Vector3d& index, std::int64_t n) {
        const Vector3d y = grid.point(index);
        int& label = labels.data<std::int32_t>()[n];
        if (y.norm() < radius) label = organ;
        for (const Bone& bone : all)
            if (bone.holds(moved ? Vector3d(bone.motion.inverse() * y) : y)) label = bone.label;
    });
    return labels;
}

const PreparedModel& ball_and_bones() {
    static const PreparedModel model = [] {
        PrepareOptions options;
        options.meshing.edge_length = 7;
        options.rigid_neighbours = {left, right};
        return prepare(map_of(bones(), false), options);
    }();
    return model;
}

const UpdateResult& registered() {
    static const UpdateResult result = [] {
        UpdateOptions options;
        options.device = Device::Cpu;
        options.align = false;
        return update(ball_and_bones(), {.labels = map_of(bones(), true)}, options);
    }();
    return result;
}

/// Farthest apart of two motions, over the bone.
double apart(const Isometry3d& a, const Isometry3d& b, const Bone& bone) {
    double most = 0;
    for (int corner = 0; corner < 8; ++corner) {
        const Vector3d sign(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1),
            x = bone.centre + bone.half.cwiseProduct(sign) / std::sqrt(3.0);
        most = std::max(most, (a * x - b * x).norm());
    }
    return most;
}

struct Notes : Observer {
    std::vector<std::string>& kept;
    explicit Notes(std::vector<std::string>& notes) : kept(notes) {}
    void note(std::string_view text) override { kept.emplace_back(text); }
};

std::vector<detail::SeenBody> seen(const std::vector<Bone>& fixed, std::vector<std::string>& notes,
                                   const imaging::Geometry& grid = room()) {
    Notes observer(notes);
    return detail::seen_bodies(*ball_and_bones().neighbours, map_of(fixed, true, grid), observer);
}

/// What a body's motion is, and the notes that it gives.
BodyMotion motion_of(const detail::SeenBody& body, const Isometry3d& placement, std::vector<std::string>& notes) {
    Notes observer(notes);
    return body.motion(placement, observer);
}

TEST(MovedBodies, EachIsFoundWhereItWent) {
    std::vector<std::string> notes;
    const auto bodies = seen(bones(), notes);
    ASSERT_EQ(bodies.size(), 2u);
    for (std::size_t n = 0; n < 2; ++n) {
        const BodyMotion found = motion_of(bodies[n], Isometry3d::Identity(), notes);
        EXPECT_TRUE(found.own);
        EXPECT_LT(apart(found.motion, bones()[n].motion, bones()[n]), 0.6);
        const BodyMotion placed = motion_of(bodies[n], bones()[n].motion, notes);
        EXPECT_FALSE(placed.own);
        EXPECT_EQ(placed.motion.matrix(), bones()[n].motion.matrix());
    }
    EXPECT_THAT(notes, IsEmpty());
}

TEST(MovedBodies, WhatStayedOrIsNotSeenWholeMovesWithThePlacement) {
    std::vector<std::string> notes;
    std::vector<Bone> still = bones();
    for (Bone& bone : still) bone.motion.setIdentity();
    for (const detail::SeenBody& body : seen(still, notes))
        EXPECT_FALSE(motion_of(body, Isometry3d::Identity(), notes).own);
    EXPECT_THAT(notes, IsEmpty());

    imaging::Geometry narrow = room();
    narrow.size[0] = 40;  // through the right one
    EXPECT_EQ(seen(bones(), notes, narrow).size(), 1u);
    EXPECT_THAT(notes, ElementsAre(HasSubstr("rigid neighbour 3 meets the border")));

    notes.clear();
    EXPECT_EQ(seen({bones()[0]}, notes).size(), 1u);
    EXPECT_THAT(notes, ElementsAre(HasSubstr("rigid neighbour 3 is not in the fixed labels")));

    notes.clear();
    std::vector<Bone> other = bones();
    other[0].half = {5, 22, 5};
    EXPECT_FALSE(motion_of(seen(other, notes)[0], Isometry3d::Identity(), notes).own);
    EXPECT_THAT(notes, ElementsAre(HasSubstr("rigid neighbour 2 has another shape")));
}

/// A plate of one voxel has places between coarser samples, a speck next to no boundary.
TEST(MovedBodies, MayBeThinOrTiny) {
    for (int k = 20; k < 24; ++k) {
        imaging::Volume labels(room(), CV_32SC1), fixed(room(), CV_32SC1);
        for (int j = 10; j < 40; ++j)
            for (int i = 10; i < 40; ++i) {
                labels.data<int>()[labels.offset(i, j, k)] = left;
                fixed.data<int>()[fixed.offset(i, j, k + 2)] = left;
            }
        labels.data<int>()[labels.offset(50, 50, k)] = right;
        fixed.data<int>()[fixed.offset(50, 50, k + 1)] = right;
        std::vector<std::string> notes;
        Notes observer(notes);
        const auto bodies = detail::seen_bodies({labels, {}}, fixed, observer);
        ASSERT_EQ(bodies.size(), 1u);
        EXPECT_THAT(notes, ElementsAre(HasSubstr("rigid neighbour 3 is too small")));
        notes.clear();
        const BodyMotion found = motion_of(bodies[0], Isometry3d::Identity(), notes);
        EXPECT_TRUE(found.own);
        EXPECT_LT((found.motion.translation() - Vector3d(0, 0, 3)).norm(), 0.3) << k;
        EXPECT_THAT(notes, ElementsAre(HasSubstr("is thin")));
    }
}

/// A cube is as well turned by 90°: it is taken to have turned by the least from the placement.
TEST(MovedBodies, AreNotTurnedAboutTheirSymmetries) {
    const auto cube = [](const Isometry3d& motion) {
        imaging::Volume labels(room(), CV_32SC1);
        test::for_each_voxel(labels, [&](const Vector3d& index, std::int64_t n) {
            const Vector3d x = motion.inverse() * room().point(index);
            if ((x - Vector3d(0, 0, -20)).cwiseAbs().maxCoeff() < 14) labels.data<int>()[n] = left;
        });
        return labels;
    };
    const Isometry3d placement = about({0, 0, -20}, 85, {0, 0, 1}, {2, 1, 0}),
                     truth = about({0, 0, -20}, 8, {1, 0, 0}, {0, 2, 1}) * placement;
    const RigidNeighbours neighbours{cube(Isometry3d::Identity()), {}};
    const auto bodies = detail::seen_bodies(neighbours, cube(truth), silent_observer());
    ASSERT_EQ(bodies.size(), 1u);
    const BodyMotion found = bodies[0].motion(placement, silent_observer());
    EXPECT_TRUE(found.own);
    EXPECT_LT(apart(found.motion, truth, {left, {0, 0, -20}, {14, 14, 14}}), 1.0);
}

/// Far from its surface, and from the organ: what is nearer may give way.
bool is_deep(Bone bone, const Vector3d& x) {
    bone.half.array() -= 4;
    return bone.holds(x) && (x - bone.centre).cwiseAbs().maxCoeff() < 11 && x[2] < -34;
}

TEST(MovedBodies, BothFieldsMoveThemRigidly) {
    const UpdateResult& result = registered();
    ASSERT_EQ(result.bodies.size(), 2u);
    const Deformation& deformation = result.deformation;
    imaging::Volume forward = displacement_moving_to_fixed(deformation, room()),
                    backward = displacement_fixed_to_moving(deformation, room());
    const PointTransform transform(deformation);
    const Unfolding forth = unfold_moving_to_fixed(forward, deformation),
                    back = unfold_fixed_to_moving(backward, deformation);
    EXPECT_EQ(forth.left + back.left, 0);
    EXPECT_EQ(field_jacobians(forward).folded, 0);
    EXPECT_EQ(field_jacobians(backward).folded, 0);
    int counted = 0;
    test::for_each_voxel(forward, [&](const Vector3d& index, std::int64_t n) {
        const Vector3d x = room().point(index);
        for (std::size_t b = 0; b < 2; ++b) {
            const Isometry3d& motion = result.bodies[b].motion;
            const Vector3d there = motion * x, from = motion.inverse() * x;
            if (is_deep(bones()[b], x)) {
                EXPECT_LT((x + test::vector_at(forward, n) - there).norm(), 0.1) << x.transpose();
                EXPECT_LT((transform(Eigen::Matrix3Xd(x)) - there).norm(), 0.1) << x.transpose();
                ++counted;
            }
            if (is_deep(bones()[b], from)) {
                EXPECT_LT((x + test::vector_at(backward, n) - from).norm(), 0.1) << x.transpose();
            }
        }
    });
    EXPECT_GT(counted, 1000);
}

TEST(MovedBodies, TheOrganDoesNotEnterThemWhereTheyWent) {
    const UpdateResult& result = registered();
    ASSERT_EQ(result.bodies.size(), 2u);
    EXPECT_LT(result.contact->deepest_mm, 0.1);
    Bone inner = bones()[0];
    inner.half.array() -= 0.8;  // boundaries of voxels
    const Eigen::Matrix3Xd nodes = result.deformation.deformed_nodes();
    for (const auto& y : nodes.colwise())
        EXPECT_FALSE(inner.holds(result.bodies[0].motion.inverse() * y)) << y.transpose();
}

/// The left one came up, and in under the ball.
TEST(MovedBodies, AreInTheWayWhereTheyWent) {
    const PreparedModel& model = ball_and_bones();
    const double energy = detail::strain_energy_unit(model, {});
    const detail::State rest{Isometry3d::Identity(), Eigen::Matrix3Xd::Zero(3, model.rest.node_count)};
    detail::ContactTerm alone(model, energy);
    EXPECT_FALSE(alone.follow(rest));
    std::vector<Bone> all = bones();
    all[0].motion = about(all[0].centre, 8, {0.2, 1, 0}, {9, -1, 9});
    std::vector<std::string> notes;
    detail::ContactTerm beside(model, energy, seen(all, notes));
    EXPECT_TRUE(beside.follow(rest));
}

TEST(MovedBodies, GoWithAStartAsThePlacementDoes) {
    const Isometry3d start = test::motion(10, {1, 2, 3}, {20, -10, 5});
    std::vector<Bone> all = bones();
    imaging::Volume labels = map_of(all, true);
    labels.geometry.origin = start * labels.geometry.origin;
    labels.geometry.direction = start.linear() * labels.geometry.direction;
    UpdateOptions options;
    options.device = Device::Cpu;
    options.align = false;
    const UpdateResult result = update(ball_and_bones(), {.labels = labels, .start = start}, options);
    ASSERT_EQ(result.bodies.size(), 2u);
    for (std::size_t n = 0; n < 2; ++n) EXPECT_LT(apart(result.bodies[n].motion, start * all[n].motion, all[n]), 0.6);
}

}  // namespace
}  // namespace tissuewarp::registration
