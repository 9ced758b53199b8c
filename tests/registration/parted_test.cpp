#include "registration/field/parted.hpp"

#include "core/errors.hpp"
#include "imaging/labels.hpp"
#include "registration/field.hpp"
#include "shapes.hpp"

#include <gtest/gtest.h>

namespace tissuewarp::registration {
namespace {

using imaging::Geometry;
using imaging::Volume;
using test::for_each_voxel;

const Geometry grid = test::plain_grid({75, 45, 45}, 1, {-12, -12, -12});

/// Blocks from x = 0 to 20.4 and from 23.4 to 43.8 mm; the second moves away from the first.
Deformation two_blocks(double away) {
    const meshing::TetMesh a = test::box_at({0, 0, 0}, {20.4, 20.4, 20.4}, {4, 4, 4}),
                           b = test::box_at({23.4, 0, 0}, {20.4, 20.4, 20.4}, {4, 4, 4});
    return test::deformed_by(test::beside(a, b), [&](const Eigen::Vector3d& X) -> Eigen::Vector3d {
        return {X[0] > 22 ? away : 0, 0, 0};
    });
}

Volume parted(const Deformation& deformation, const Geometry& where) {
    return parted_after(deformation, displacement_fixed_to_moving(deformation, where));
}

// The gap of 3 mm opens to 9: what lay in it is drawn out threefold. What lies around moves with what is next to it.
TEST(Parted, IsTheGapBetweenPartsThatMoveApart) {
    const Volume found = parted(two_blocks(6), grid);
    int in_gap = 0, beside = 0;
    for_each_voxel(found, [&](const Eigen::Vector3d& index, std::int64_t n) {
        const Eigen::Vector3d y = grid.point(index);
        const bool middle = y[1] > 3 && y[1] < 17 && y[2] > 3 && y[2] < 17;
        const bool marked = found.data<std::uint8_t>()[n] != 0;
        if (middle && y[0] > 22 && y[0] < 28) in_gap += marked;
        if (y[0] < 20.4 || y[0] > 29.4 || y[1] < -6 || y[1] > 27) beside += marked;
    });
    EXPECT_GT(in_gap, 0.9 * 5 * 13 * 13);
    EXPECT_EQ(beside, 0);
    EXPECT_LT(imaging::millilitres(found), 9 * 28 * 28 / 1000.0);
}

TEST(Parted, IsNothingWhereTissueStaysOrMovesAsAWhole) {
    EXPECT_EQ(imaging::millilitres(parted(two_blocks(0), grid)), 0);
    EXPECT_EQ(imaging::millilitres(parted(two_blocks(-1), grid)), 0);
    Deformation turned = two_blocks(0);
    turned.placement = test::motion(20, {0.2, 1, 0.4}, {5, -3, 8});
    EXPECT_EQ(imaging::millilitres(parted(turned, grid)), 0);
}

TEST(Parted, IsNeverRigid) {
    Deformation deformation = two_blocks(6);
    Surroundings surroundings{.rigid = Volume(grid, CV_8UC1)};
    for_each_voxel(surroundings.rigid, [&](const Eigen::Vector3d& index, std::int64_t n) {
        surroundings.rigid.data<std::uint8_t>()[n] = grid.point(index)[1] > 10 ? 1 : 0;
    });
    deformation.surroundings = surroundings;
    const Volume found = parted(deformation, grid);
    int rigid = 0, other = 0;
    for_each_voxel(found, [&](const Eigen::Vector3d& index, std::int64_t n) {
        (grid.point(index)[1] > 10 ? rigid : other) += found.data<std::uint8_t>()[n];
    });
    EXPECT_EQ(rigid, 0);
    EXPECT_GT(other, 0);
}

TEST(Parted, RefusesWhatIsNoField) {
    EXPECT_THROW(parted_after(two_blocks(0), Volume(grid, CV_32FC1)), InvalidInput);
}

}  // namespace
}  // namespace tissuewarp::registration
