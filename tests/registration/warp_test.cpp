#include "registration/warp.hpp"

#include "core/errors.hpp"
#include "imaging/image_io.hpp"
#include "imaging/labels.hpp"
#include "meshing/point_location.hpp"
#include "registration/field.hpp"
#include "shapes.hpp"
#include "tests/support/folders.hpp"
#include "tests/support/label_shapes.hpp"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cstring>

namespace tissuewarp::registration {
namespace {

using imaging::Geometry;
using imaging::Volume;
using test::for_each_voxel;

/// A field given by a function of the point.
template <class Function>
Volume field_of(const Geometry& grid, const Function& function) {
    Volume field(grid, CV_32FC3);
    for_each_voxel(field, [&](const Eigen::Vector3d& index, std::int64_t n) {
        const Eigen::Vector3d d = function(grid.point(index));
        for (int c = 0; c < 3; ++c) field.data<cv::Vec3f>()[n][c] = static_cast<float>(d[c]);
    });
    return field;
}

TEST(WarpImage, PullsALinearImageExactlyWhateverTheAxes) {
    const Geometry moving_grid = test::oblique_grid({0, 0, 0}, {41, 43, 39}, {1.5, 1.2, 1.9});
    const Eigen::Vector3d slope(2.0, -1.0, 0.5);
    Volume moving(moving_grid, CV_32FC1);
    for_each_voxel(moving, [&](const Eigen::Vector3d& index, std::int64_t n) {
        moving.data<float>()[n] = static_cast<float>(slope.dot(moving_grid.point(index)));
    });
    const Geometry fixed_grid = test::plain_grid({13, 15, 11}, 1.7, {-9, -12, -8});
    const auto shift = [](const Eigen::Vector3d& p) { return Eigen::Vector3d(1.0 + 0.1 * p[1], -0.05 * p[0], 0.7); };
    const Volume warped = warp_image(moving, field_of(fixed_grid, shift), -1000.0);
    for_each_voxel(warped, [&](const Eigen::Vector3d& index, std::int64_t n) {
        const Eigen::Vector3d p = fixed_grid.point(index);
        ASSERT_NEAR(warped.data<float>()[n], slope.dot(p + shift(p)), 1e-4);
    });
}

TEST(WarpImage, KeepsTheVoxelTypeAndRounds) {
    const Geometry grid = test::plain_grid({4, 2, 2});
    Volume moving(grid, CV_16SC1);
    for_each_voxel(moving, [&](const Eigen::Vector3d& index, std::int64_t n) {
        moving.data<std::int16_t>()[n] = static_cast<std::int16_t>(-10 * index[0]);
    });
    const Volume warped = warp_image(moving, field_of(grid, [](const auto&) { return Eigen::Vector3d(0.36, 0, 0); }));
    ASSERT_EQ(warped.voxels.type(), CV_16SC1);
    EXPECT_EQ(warped.data<std::int16_t>()[0], -4);   // −3.6
    EXPECT_EQ(warped.data<std::int16_t>()[1], -14);  // −13.6
}

TEST(WarpImage, FillsWhatLayOutsideTheMovingImage) {
    const Geometry grid = test::plain_grid({5, 5, 5});
    Volume moving(grid, CV_8UC1);
    moving.voxels.setTo(100);
    const Volume warped =
        warp_image(moving, field_of(grid, [](const auto&) { return Eigen::Vector3d(2.0, 0, 0); }), 7.0);
    for_each_voxel(warped, [&](const Eigen::Vector3d& index, std::int64_t n) {
        EXPECT_EQ(warped.data<std::uint8_t>()[n], index[0] <= 2 ? 100 : 7);
    });
    Volume broken = field_of(grid, [](const auto&) { return Eigen::Vector3d(std::nan(""), 0, 0); });
    EXPECT_EQ(cv::norm(warp_image(moving, broken, 7.0).voxels, cv::NORM_INF), 7.0);
}

TEST(WarpImage, WarpsVectorsComponentwise) {
    const Geometry grid = test::plain_grid({6, 5, 4});
    const Volume moving = field_of(grid, [](const Eigen::Vector3d& p) { return Eigen::Vector3d(p[0], 2 * p[1], 5.0); });
    const Volume warped = warp_image(moving, field_of(grid, [](const auto&) { return Eigen::Vector3d(0.5, 0, 0); }));
    ASSERT_EQ(warped.voxels.type(), CV_32FC3);
    const Eigen::Vector3d value = test::vector_at(warped, warped.offset(2, 3, 1));
    EXPECT_LT((value - Eigen::Vector3d(2.5, 6.0, 5.0)).norm(), 1e-5);
}

TEST(WarpLabels, TakesTheNearestVoxelAndInventsNothing) {
    const Geometry grid = test::plain_grid({6, 1, 1});
    Volume labels(grid, CV_32SC1);
    for (int i = 0; i < 6; ++i) labels.data<std::int32_t>()[i] = i < 3 ? 1 : 900000001;
    const Volume warped = warp_labels(labels, field_of(grid, [](const auto&) { return Eigen::Vector3d(1.4, 0, 0); }));
    const std::vector<std::int32_t> expected{1, 1, 900000001, 900000001, 900000001, 0};
    EXPECT_EQ(std::vector<std::int32_t>(warped.data<std::int32_t>(), warped.data<std::int32_t>() + 6), expected);
}

TEST(Warp, RefusesWhatItCannotUse) {
    const Geometry grid = test::plain_grid({4, 4, 4});
    const Volume field(grid, CV_32FC3), image(grid, CV_8UC1), grey(grid, CV_32FC1);
    EXPECT_THROW(warp_image(Volume(), field), InvalidInput);
    EXPECT_THROW(warp_image(image, image), InvalidInput);
    EXPECT_THROW(warp_image(image, Volume()), InvalidInput);
    EXPECT_THROW(warp_labels(grey, field), InvalidInput);
}

TEST(WarpLabels, OfARealHeadFollowAnAnalyticField) {
    // A deformation known in closed form: y = X + a (0, 0, sin²(x/40) …), shear only, whose inverse is explicit. Each
    // warped voxel must hold the label found at the exact preimage.
    const std::filesystem::path folder = tissuewarp::test::source_folder() / "data/brainshift";
    const Volume labels = imaging::read_labels(folder / "preop_labels.nii.gz");
    const Geometry& grid = labels.geometry;
    const auto u = [](const Eigen::Vector3d& X) {
        return Eigen::Vector3d(0, 0, 6.0 * std::sin(X[0] / 40.0) * std::cos(X[1] / 50.0));  // depends on x, y alone
    };
    const Eigen::Vector3d lower = grid.point({0, 0, 0}).cwiseMin(
        grid.point(Eigen::Vector3d(grid.size[0] - 1, grid.size[1] - 1, grid.size[2] - 1)));
    const Deformation deformation =
        test::deformed_by(test::box_at(lower.array() - 8.0, {191, 228, 186}, {48, 57, 12}), u);
    const Volume warped = warp_labels(labels, displacement_fixed_to_moving(deformation, grid));
    std::int64_t different = 0, tissue = 0;
    for_each_voxel(warped, [&](const Eigen::Vector3d& index, std::int64_t n) {
        const Eigen::Vector3d y = grid.point(index);
        const Eigen::Vector3d source = grid.index(y - u(y)).array().round();
        const bool in = (source.array() >= 0.0).all() && source[0] < grid.size[0] && source[1] < grid.size[1] &&
                        source[2] < grid.size[2];
        const int expected =
            in ? labels.data<std::int32_t>()[labels.offset(static_cast<int>(source[0]), static_cast<int>(source[1]),
                                                           static_cast<int>(source[2]))]
               : 0;
        tissue += expected != 0;
        different += warped.data<std::int32_t>()[n] != expected;
    });
    EXPECT_GT(tissue, 1000000);
    // Linear elements of 4 mm miss the sine by at most 6 (4/40)² / 8 = 0.008 mm along each axis: a voxel in a hundred
    // rounds to its neighbour, and of those only the ones at a boundary change their label.
    EXPECT_LT(different, tissue / 500);
    EXPECT_EQ(imaging::labels_in(warped), imaging::labels_in(labels));
}

TEST(WarpImage, DoesNotDependOnTheNumberOfThreads) {
    const Geometry grid = test::plain_grid({30, 31, 32});
    Volume moving(grid, CV_32FC1);
    cv::RNG generator(7);
    for (std::int64_t n = 0; n < grid.voxel_count(); ++n) moving.data<float>()[n] = generator.uniform(0.0F, 1.0F);
    const Volume field = field_of(grid, [](const Eigen::Vector3d& p) { return Eigen::Vector3d(0.1 * p[1], 0.3, 1.1); });
    Volume warped[2];
    for (const int threads : {1, 2}) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                        static_cast<std::size_t>(threads));
        warped[threads - 1] = warp_image(moving, field);
    }
    EXPECT_EQ(std::memcmp(warped[0].voxels.data, warped[1].voxels.data, warped[0].voxels.total() * sizeof(float)), 0);
}

/// Voxels in the mesh are those of the field's warp, all others those of the placement's.
TEST(WarpByMesh, IsTheFieldsWarpInTheMeshAndThePlacementsOutside) {
    const Geometry moving_grid = test::oblique_grid({0, 0, 0}, {50, 52, 48}, {1.2, 1.1, 1.3});
    Volume moving(moving_grid, CV_16SC1);
    for_each_voxel(moving, [&](const Eigen::Vector3d& index, std::int64_t n) {
        const Eigen::Vector3d p = moving_grid.point(index);
        moving.data<std::int16_t>()[n] = static_cast<std::int16_t>(500 * std::sin(0.2 * p[0]) + 10 * p[1] - 7 * p[2]);
    });
    Deformation deformation =
        test::deformed_by(test::box_at({-12, -11, -10}, {24, 22, 20}, {6, 6, 6}), [](const Eigen::Vector3d& X) {
            return Eigen::Vector3d(0.03 * X[1], 1.5 * std::cos(0.1 * X[0]), 0.002 * X[0] * X[2]);
        });
    deformation.placement = shapes::motion(11, {1, 2, -1}, {3, -2, 4});
    const Geometry fixed_grid = test::plain_grid({44, 40, 42}, 1.0, {-20, -22, -15});
    const Volume warped = warp_by_mesh(moving, deformation, fixed_grid, -99);
    const Volume expected = warp_image(moving, displacement_fixed_to_moving(deformation, fixed_grid), -99);
    Deformation rigid = deformation;
    rigid.displacement.setZero();
    const Volume placed = warp_image(moving, displacement_fixed_to_moving(rigid, fixed_grid), -99);
    const meshing::PointLocator locator(deformation.deformed_mesh());
    int inside = 0, outside = 0;
    for_each_voxel(warped, [&](const Eigen::Vector3d& index, std::int64_t n) {
        const bool in_mesh = locator.find(fixed_grid.point(index)).has_value();
        ++(in_mesh ? inside : outside);
        ASSERT_NEAR(warped.data<std::int16_t>()[n], (in_mesh ? expected : placed).data<std::int16_t>()[n], 1);
    });
    EXPECT_GT(inside, 8000);
    EXPECT_GT(outside, 8000);
}

TEST(WarpByMesh, RefusesWhatIsNotFinite) {
    Deformation deformation =
        test::deformed_by(test::box_at({0, 0, 0}, {9, 9, 9}, {1, 1, 1}),
                          [](const Eigen::Vector3d&) { return Eigen::Vector3d::Constant(std::nan("")); });
    const Volume moving(test::plain_grid({5, 5, 5}), CV_8UC1);
    EXPECT_THROW(warp_by_mesh(moving, deformation, moving.geometry), InvalidInput);
    EXPECT_THROW(warp_by_mesh({}, deformation, moving.geometry), InvalidInput);
}

}  // namespace
}  // namespace tissuewarp::registration
