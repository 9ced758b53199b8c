#include "registration/surroundings/rigid_surroundings.hpp"

#include "core/errors.hpp"
#include "imaging/sampling.hpp"
#include "meshing/point_location.hpp"
#include "registration/evaluation.hpp"
#include "registration/evaluation/percentile.hpp"
#include "registration/field/inverse_transform.hpp"
#include "registration/field/parted.hpp"
#include "tests/support/noted.hpp"
#include "textured_phantom.hpp"

#include <gtest/gtest.h>

namespace tissuewarp::registration {
namespace {

using imaging::Geometry;
using imaging::Volume;
using test::for_each_voxel;
using test::vector_at;

const Eigen::Isometry3d of_bone = test::motion(8, {0.2, 1, 0.4}, {5, -3, 8});
constexpr double organ_radius = 40, bone_from = 43, bone_to = 52;

/// The organ's surface sinks by up to 7 mm on one side, as a brain does in a craniotomy; it rises on none.
Eigen::Vector3d sag(const Eigen::Vector3d& X) {
    const double r = (X - Eigen::Vector3d(organ_radius, 0, 0)).norm();
    return r < 30 ? Eigen::Vector3d(-3.5 * (1 + std::cos(EIGEN_PI * r / 30)), 0, 0) : Eigen::Vector3d::Zero();
}

/// A ball in a shell of bone with texture, fluid between them and skin around.
double head(const Eigen::Vector3d& X) {
    static const test::Texture texture;
    const double r = X.norm();
    if (r < organ_radius) return 60 + 15 * texture(X);
    if (r < bone_from) return 20;
    if (r < bone_to) return 120 + 40 * texture(X);
    return r < 58 ? 80 + 20 * texture(X) : 0;
}

Deformation sagged() {
    Deformation deformation = test::deformed_by(test::ball({0, 0, 0}, organ_radius, 16), sag);
    deformation.placement = of_bone;
    return deformation;
}

/// The same, from an alignment of the organ that its sag has drawn away from the bone.
Deformation misplaced() {
    return sagged().with_placement(of_bone * test::motion(0.8, {1, 0.3, 0}, {0.9, -0.2, 0.4}));
}

const Geometry grid = test::plain_grid({62, 62, 62}, 2, {-61, -61, -61});

/// What is seen afterwards: the organ sagged, and everything around it moved by `around` of the continued displacement.
Volume seen_after(const Deformation& deformation, double around) {
    Deformation moved = deformation;
    const Geometry to = test::plain_grid({68, 68, 68}, 2, deformation.placement * Eigen::Vector3d(-66, -66, -66));
    const InversePointTransform inverse(moved);
    return test::sampled(
        to,
        [&](const Eigen::Vector3d& y) {
            const Eigen::Vector3d z = deformation.placement.inverse() * y;
            if (around == 0 && z.norm() > bone_from) return head(z);
            const Eigen::Vector3d X = inverse(Eigen::Matrix3Xd(y)).col(0);
            if (around == 0 && X.norm() > organ_radius) return 20.0;  // fluid fills the gap
            return head(X);
        },
        1.5, 3);
}

struct Share {
    int of = 0, all = 0;
    [[nodiscard]] double value() const { return all > 0 ? double(of) / all : 0; }
};

/// Of the bone beside which the organ sank by more than a voxel.
Share held_bone(const Volume& mask) {
    Share share;
    for_each_voxel(mask, [&](const Eigen::Vector3d& index, std::int64_t n) {
        const Eigen::Vector3d X = mask.geometry.point(index);
        if (X.norm() < bone_from + 1 || X.norm() > bone_to - 1 || sag(organ_radius * X.normalized()).norm() < 2) return;
        ++share.all;
        share.of += mask.data<std::uint8_t>()[n] != 0;
    });
    return share;
}

// Before, the field went on smoothly from the organ and bent the bone by as much as the organ had moved.
TEST(RigidSurroundings, BoneThatStayedIsHeldInBothFieldsWhichDoNotFold) {
    Deformation deformation = misplaced();
    const Volume moving = test::sampled(grid, head, 1.5, 2), fixed = seen_after(sagged(), 0);
    deformation.surroundings = rigid_surroundings(deformation, moving, fixed);
    ASSERT_TRUE(deformation.surroundings);
    const Volume& rigid = deformation.surroundings->rigid;
    const Eigen::Isometry3d& motion = deformation.surroundings->motion;
    const Share held = held_bone(rigid);
    const Eigen::Isometry3d off = motion.inverse() * of_bone;  // a tenth of a voxel at the bone
    EXPECT_LT(Eigen::AngleAxisd(off.linear()).angle() * bone_to + off.translation().norm(), 0.2);
    ASSERT_GT(held.all, 300);
    EXPECT_GT(held.value(), 0.98);

    const Volume forward = displacement_moving_to_fixed(deformation, grid);
    const PointTransform at(deformation);
    const InversePointTransform back(deformation);
    std::vector<double> forward_off, backward_off;
    for_each_voxel(forward, [&](const Eigen::Vector3d& index, std::int64_t n) {
        const Eigen::Vector3d X = grid.point(index), y = motion * X;
        if (!imaging::nearest_value<std::uint8_t>(rigid, X)) return;
        const double beside = (vector_at(forward, n) - (y - X)).norm();
        forward_off.push_back(beside);
        ASSERT_NEAR((at(Eigen::Matrix3Xd(X)).col(0) - y).norm(), beside, 1e-4);
        if (beside > 1e-6) return;
        ASSERT_LT((back(Eigen::Matrix3Xd(y)).col(0) - X).norm(), 1e-4) << X.transpose();
    });
    ASSERT_GT(forward_off.size(), 1000U);
    EXPECT_LT(detail::percentile(forward_off, 95), 0.1);
    EXPECT_EQ(field_jacobians(forward).folded, 0);
    const Geometry placed = fixed.geometry;
    const Volume backward = displacement_fixed_to_moving(deformation, placed);
    EXPECT_EQ(field_jacobians(backward).folded, 0);
    for_each_voxel(backward, [&](const Eigen::Vector3d& index, std::int64_t n) {
        const Eigen::Vector3d y = placed.point(index), z = motion.inverse() * y;
        if (!imaging::nearest_value<std::uint8_t>(rigid, z) || z.norm() < bone_from) return;
        backward_off.push_back((vector_at(backward, n) - (z - y)).norm());
    });
    ASSERT_GT(backward_off.size(), 1000U);
    EXPECT_LT(detail::percentile(backward_off, 95), 0.1);
}

TEST(RigidSurroundings, WhatMovedAlongWithTheOrganIsNotHeld) {
    const Deformation deformation = sagged();
    const Volume moving = test::sampled(grid, head, 1.5, 2), fixed = seen_after(deformation, 1);
    const auto found = rigid_surroundings(deformation, moving, fixed);
    ASSERT_TRUE(found);
    EXPECT_LT(held_bone(found->rigid).value(), 0.1);
}

TEST(RigidSurroundings, AnImageWithoutStructureHoldsNothing) {
    const Deformation deformation = sagged();
    const Volume moving = test::sampled(
        grid, [](const auto&) { return 50.0; }, 1.5, 2);
    const Volume fixed = test::sampled(
        seen_after(deformation, 0).geometry, [](const auto&) { return 50.0; }, 1.5, 4);
    EXPECT_FALSE(rigid_surroundings(deformation, moving, fixed));
}

TEST(RigidSurroundings, ContrastMayDifferAndTheOrganIsNeverAmongThem) {
    const Deformation deformation = sagged();
    const Volume moving = test::sampled(grid, head, 1.5, 2);
    Volume fixed = seen_after(deformation, 0);
    fixed.voxels = 300 - 0.5 * fixed.voxels;
    const auto found = rigid_surroundings(deformation, moving, fixed);
    ASSERT_TRUE(found);
    const Volume& mask = found->rigid;
    EXPECT_GT(held_bone(mask).value(), 0.98);
    const Eigen::Matrix3Xd& before = deformation.mesh.nodes;
    const Eigen::Matrix3Xd after = before + deformation.displacement;
    const meshing::PointLocator organ(deformation.mesh), sunk({after, deformation.mesh.tets, deformation.mesh.labels});
    for_each_voxel(mask, [&](const Eigen::Vector3d& index, std::int64_t n) {
        if (!mask.data<std::uint8_t>()[n]) return;
        const Eigen::Vector3d X = mask.geometry.point(index);
        ASSERT_FALSE(organ.find(X) || sunk.find(X)) << X.transpose();
    });
}

TEST(RigidSurroundings, ImagesOfSeveralComponentsLeaveWhatIsKnown) {
    Deformation deformation = sagged();
    const Volume vectors(grid, CV_32FC3);
    EXPECT_FALSE(rigid_surroundings(deformation, vectors, vectors));
    deformation.surroundings = rigid_bodies(Volume(grid, CV_32SC1), {}, deformation);
    const auto same = rigid_surroundings(deformation, vectors, vectors);
    ASSERT_TRUE(same);
    EXPECT_EQ(same->rigid.voxels.data, deformation.surroundings->rigid.voxels.data);
}

/// The organ turned in its shell, 10 mm along it at the equator.
Deformation turned() {
    const Eigen::Isometry3d turn = test::motion(15, {0, 0, 1}, {0, 0, 0});
    Deformation deformation = test::deformed_by(test::ball({0, 0, 0}, organ_radius, 16), [&](const Eigen::Vector3d& X) {
        return Eigen::Vector3d(turn * X - X);
    });
    deformation.placement = of_bone;
    return deformation;
}

/// What is seen afterwards: bone stayed, and around it the skin.
Volume turned_image() {
    const Eigen::Isometry3d back = test::motion(-15, {0, 0, 1}, {0, 0, 0});
    return test::sampled(
        test::plain_grid({68, 68, 68}, 2, of_bone * Eigen::Vector3d(-66, -66, -66)),
        [&](const Eigen::Vector3d& y) {
            const Eigen::Vector3d z = of_bone.inverse() * y;
            return head(z.norm() > organ_radius ? z : Eigen::Vector3d(back * z));
        },
        1.5, 3);
}

TEST(RigidSurroundings, AnOrganThatSlidAlongThemDragsNothing) {
    Deformation deformation = turned();
    const Volume moving = test::sampled(grid, head, 1.5, 2), fixed = turned_image();
    tissuewarp::test::Noted observer;
    deformation.surroundings = rigid_surroundings(deformation, moving, fixed, {}, observer);
    ASSERT_TRUE(deformation.surroundings);
    EXPECT_TRUE(deformation.surroundings->slide);
    EXPECT_EQ(observer.notes, std::string(sliding_note) + "\n");
    const Eigen::Isometry3d& motion = deformation.surroundings->motion;
    Volume forward = displacement_moving_to_fixed(deformation, grid);
    Volume backward = displacement_fixed_to_moving(deformation, fixed.geometry);
    const Unfolding forth = unfold_moving_to_fixed(forward, deformation),
                    back = unfold_fixed_to_moving(backward, deformation);
    EXPECT_EQ(forth.left + back.left, 0);
    // A layer shears beside the organ: with a jump 101 of its voxels gave way.
    EXPECT_LT(std::max(forth.in_organ, back.in_organ), 0.002 * double(forth.organ));
    std::vector<double> bone_off, organ_off;
    for_each_voxel(forward, [&](const Eigen::Vector3d& index, std::int64_t n) {
        const Eigen::Vector3d X = grid.point(index);
        if (X.norm() > bone_from && X.norm() < bone_to)
            bone_off.push_back((X + vector_at(forward, n) - motion * X).norm());
        if (X.norm() < organ_radius - 3) {
            const Eigen::Vector3d y = of_bone * (test::motion(15, {0, 0, 1}, {0, 0, 0}) * X);
            organ_off.push_back((X + vector_at(forward, n) - y).norm());
        }
    });
    EXPECT_LT(detail::percentile(bone_off, 95), 0.3);
    EXPECT_LT(detail::percentile(organ_off, 95), 0.3);
    bone_off.clear();
    for_each_voxel(backward, [&](const Eigen::Vector3d& index, std::int64_t n) {
        const Eigen::Vector3d y = backward.geometry.point(index), z = motion.inverse() * y;
        if (z.norm() > bone_from && z.norm() < bone_to) bone_off.push_back((y + vector_at(backward, n) - z).norm());
    });
    EXPECT_LT(detail::percentile(bone_off, 95), 0.3);
}

TEST(RigidSurroundings, WhatTurnedAlongWithTheOrganWasNotSlidAlong) {
    const Deformation deformation = turned();
    const Volume moving = test::sampled(grid, head, 1.5, 2), fixed = seen_after(deformation, 1);
    tissuewarp::test::Noted observer;
    const auto found = rigid_surroundings(deformation, moving, fixed, {}, observer);
    EXPECT_FALSE(found && found->slide);
    EXPECT_EQ(observer.notes, "");
}

// Differences of what lies next to the organ reach across the jump: they are not asked.
TEST(RigidSurroundings, WhereAnOrganSlidNothingParted) {
    Deformation deformation = turned();
    deformation.surroundings = Surroundings{of_bone, Volume(grid, CV_8UC1), true};
    const Geometry there = test::plain_grid({68, 68, 68}, 2, of_bone * Eigen::Vector3d(-66, -66, -66));
    const Volume backward = displacement_fixed_to_moving(deformation, there);
    EXPECT_EQ(cv::countNonZero(cv::Mat(1, int(there.voxel_count()), CV_8UC1,
                                       parted_after(deformation, backward).data<std::uint8_t>())),
              0);
}

// A lung that breathes out moves by centimetres along its ribs: a field from the one to the other folds.
TEST(RigidSurroundings, AnOrganThatMovedAwayAsAWholeIsNotBridged) {
    Deformation away = sagged();
    away.placement = of_bone * test::motion(0, {1, 0, 0}, {0, 10, 0});
    const Volume moving = test::sampled(grid, head, 1.5, 2);
    EXPECT_FALSE(rigid_surroundings(away, moving, seen_after(sagged(), 0)));
}

TEST(RigidSurroundings, FieldsRefuseWhatIsNone) {
    Deformation deformation = sagged();
    deformation.surroundings = {test::motion(1, {1, 0, 0}, {0, std::nan(""), 0}), Volume(grid, CV_8UC1)};
    EXPECT_THROW(displacement_moving_to_fixed(deformation, grid), InvalidInput);
    deformation.surroundings = {of_bone, Volume(grid, CV_32FC1)};
    EXPECT_THROW(displacement_fixed_to_moving(deformation, grid), InvalidInput);
}

}  // namespace
}  // namespace tissuewarp::registration
