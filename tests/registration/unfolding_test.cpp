#include "core/errors.hpp"
#include "registration/evaluation.hpp"
#include "registration/field.hpp"
#include "shapes.hpp"

#include <gtest/gtest.h>

#include <cstring>

namespace tissuewarp::registration {
namespace {

using imaging::Geometry;
using imaging::Volume;
using test::for_each_voxel;
using test::vector_at;

const Geometry grid = test::plain_grid({47, 25, 25}, 1, {-2, -2, -2});

/// Blocks from x = 0 to 20.4 and from 22.4 to 42.8 mm; the second moves by `second`.
Deformation two_blocks(const Eigen::Vector3d& second) {
    const meshing::TetMesh a = test::box_at({0, 0, 0}, {20.4, 20.4, 20.4}, {4, 4, 4}),
                           b = test::box_at({22.4, 0, 0}, {20.4, 20.4, 20.4}, {4, 4, 4});
    return test::deformed_by(test::beside(a, b), [&](const Eigen::Vector3d& X) -> Eigen::Vector3d {
        return X[0] > 21 ? second : Eigen::Vector3d::Zero();
    });
}

bool in_a_block(const Eigen::Vector3d& X, double margin) {
    const double far = 20.4 - margin, x = X[0] > 21 ? X[0] - 22.4 : X[0];
    return x > margin && x < far && X[1] > margin && X[1] < far && X[2] > margin && X[2] < far;
}

/// Largest change at voxels whose centres are chosen, mm.
template <class Choose>
double most_changed(const Volume& before, const Volume& after, const Choose& choose) {
    double most = 0;
    for_each_voxel(before, [&](const Eigen::Vector3d& index, std::int64_t n) {
        if (choose(grid.point(index))) most = std::max(most, (vector_at(after, n) - vector_at(before, n)).norm());
    });
    return most;
}

/// Folds it beside both blocks and in the corner of the grid, all beside the mesh.
void fold_beside(Volume& field) {
    for (const Eigen::Vector3i& at : {Eigen::Vector3i(23, 10, 10), {23, 24, 14}, {0, 0, 0}})
        field.data<cv::Vec3f>()[field.offset(at[0], at[1], at[2])] += cv::Vec3f(3, -2, 2.5);
    ASSERT_GT(field_jacobians(field).folded, 0);
}

TEST(Unfolding, LeavesAFieldWithoutFoldsAsItIs) {
    const Deformation deformation = two_blocks({-1, 0.5, 0});
    const Volume before = displacement_moving_to_fixed(deformation, grid);
    ASSERT_GT(field_jacobians(before).minimum, 0.05);
    Volume after = before.clone();
    EXPECT_EQ(unfold_moving_to_fixed(after, deformation).voxels, 0);
    EXPECT_EQ(std::memcmp(after.voxels.data, before.voxels.data, after.voxels.total() * after.voxels.elemSize()), 0);
}

TEST(Unfolding, TakesFoldsBesideTheMeshOutBesideTheMesh) {
    const Deformation deformation = two_blocks({-1, 0.5, 0});
    Volume before = displacement_moving_to_fixed(deformation, grid);
    fold_beside(before);
    Volume after = before.clone();
    const Unfolding unfolding = unfold_moving_to_fixed(after, deformation);
    EXPECT_GT(field_jacobians(after).minimum, 0.05);
    EXPECT_GT(unfolding.voxels, 3);
    EXPECT_EQ(unfolding.in_organ, 0);
    EXPECT_EQ(unfolding.left, 0);
    EXPECT_EQ(most_changed(before, after, [](const Eigen::Vector3d& X) { return in_a_block(X, 1e-6); }), 0);
    EXPECT_LT(unfolding.voxels, 500);
}

// The second block enters the first by 1 mm: no field without folds carries both.
TEST(Unfolding, GivesWayOnTheRimOfPartsThatPassIntoEachOther) {
    const Deformation deformation = two_blocks({-3, 0, 0});
    const Volume before = displacement_moving_to_fixed(deformation, grid);
    ASSERT_GT(field_jacobians(before).folded, 300);
    Volume after = before.clone();
    const Unfolding unfolding = unfold_moving_to_fixed(after, deformation);
    EXPECT_EQ(field_jacobians(after).folded, 0);
    EXPECT_GT(unfolding.in_organ, 300);
    EXPECT_GT(unfolding.most_in_organ_mm, 0.2);
    EXPECT_LT(unfolding.most_in_organ_mm, 3);
    EXPECT_EQ(most_changed(before, after, [](const Eigen::Vector3d& X) { return in_a_block(X, 1.001); }), 0);
}

TEST(Unfolding, KnowsWhereTheOrganLiesInTheFixedFrame) {
    Deformation deformation = two_blocks({-1, 0.5, 0});
    deformation.placement = test::motion(30, {0.3, 1, 0.2}, {40, -20, 10});
    Geometry fixed_grid = grid;
    fixed_grid.origin = deformation.placement * grid.origin;
    fixed_grid.direction = deformation.placement.linear();
    Volume before = displacement_fixed_to_moving(deformation, fixed_grid);
    fold_beside(before);
    Volume after = before.clone();
    const Unfolding unfolding = unfold_fixed_to_moving(after, deformation);
    EXPECT_EQ(field_jacobians(after).folded, 0);
    EXPECT_EQ(unfolding.in_organ, 0);
    const Eigen::Isometry3d to_moving = deformation.placement.inverse();
    const auto in_moved_block = [&](const Eigen::Vector3d& y) {
        const Eigen::Vector3d z = to_moving * y;
        return in_a_block(z[0] > 20.8 ? Eigen::Vector3d(z - Eigen::Vector3d(-1, 0.5, 0)) : z, 1e-6);
    };
    EXPECT_EQ(most_changed(before, after, in_moved_block), 0);
}

TEST(Unfolding, DoesNotBendRigidSurroundings) {
    Deformation deformation = two_blocks({-3, 0, 0});
    Surroundings surroundings{.rigid = Volume(grid, CV_8UC1)};
    surroundings.rigid.voxels = cv::Scalar(0);
    const auto rigid = [](const Eigen::Vector3d& X) { return X[1] > 21.5; };
    for_each_voxel(surroundings.rigid, [&](const Eigen::Vector3d& index, std::int64_t n) {
        surroundings.rigid.data<std::uint8_t>()[n] = rigid(grid.point(index)) ? 1 : 0;
    });
    deformation.surroundings = surroundings;
    const Volume before = displacement_moving_to_fixed(deformation, grid);
    Volume after = before.clone();
    EXPECT_GT(unfold_moving_to_fixed(after, deformation).voxels, 0);
    EXPECT_EQ(most_changed(before, after, rigid), 0);
}

// A map that turns all inside out is no map with a few folds.
TEST(Unfolding, LeavesAFieldThatFoldsEverywhere) {
    Volume field(grid, CV_32FC3);
    for_each_voxel(field, [&](const Eigen::Vector3d& index, std::int64_t n) {
        field.data<cv::Vec3f>()[n] = cv::Vec3f(float(-2 * index[0]), 0, 0);
    });
    const Volume before = field.clone();
    const Unfolding unfolding = unfold_moving_to_fixed(field, two_blocks({0, 0, 0}));
    EXPECT_EQ(unfolding.voxels, 0);
    EXPECT_EQ(unfolding.left, grid.voxel_count());
    EXPECT_EQ(std::memcmp(field.voxels.data, before.voxels.data, field.voxels.total() * field.voxels.elemSize()), 0);
}

TEST(Unfolding, RefusesWhatIsNoField) {
    Volume scalars(grid, CV_32FC1);
    EXPECT_THROW(unfold_moving_to_fixed(scalars, two_blocks({0, 0, 0})), InvalidInput);
}

}  // namespace
}  // namespace tissuewarp::registration
