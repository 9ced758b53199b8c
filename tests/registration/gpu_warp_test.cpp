/// The warp on a device (Mesa's llvmpipe where there is no GPU) against its twin on the CPU.
#include "registration/gpu_warp.hpp"

#include "core/errors.hpp"
#include "imaging/image_io.hpp"
#include "meshing/mesher.hpp"
#include "registration/field.hpp"
#include "registration/field/gpu_warp_check.hpp"
#include "registration/warp.hpp"
#include "shapes.hpp"
#include "tests/support/folders.hpp"

#include <gmock/gmock.h>

#include <cstring>

namespace tissuewarp::registration {
namespace {

using imaging::Geometry;
using imaging::Interpolation;
using imaging::Volume;
using test::for_each_voxel;
using test::vector_at;
using ::testing::HasSubstr;

Eigen::Vector3d smooth_displacement(const Eigen::Vector3d& X) {
    return 3.0 * Eigen::Vector3d(std::sin(X[1] / 9.0), std::cos(X[2] / 11.0), std::sin(X[0] / 10.0 + 1.0));
}

Volume noise(const Geometry& grid, int type) {
    Volume volume(grid, type);
    cv::RNG(3).fill(volume.voxels, cv::RNG::UNIFORM, 0.0, 1000.0);
    return volume;
}

/// A box of 40 × 30 × 20 mm around the origin, deformed and placed, seen by an oblique left-handed grid of anisotropic
/// voxels that reaches beyond it, and an image of which it fills the middle.
struct Scene {
    Deformation deformation =
        test::deformed_by(test::box_at({-20, -15, -10}, {40, 30, 20}, {8, 6, 4}, 0.15), smooth_displacement);
    Geometry output = test::oblique_grid({6.0, -5.0, 8.0}, {57, 43, 31}, {1.1, 0.9, 1.4});
    Geometry moving = test::oblique_grid({1.0, 0.5, -0.4}, {45, 33, 37}, {1.3, 1.4, 0.9});

    Scene() { deformation.placement = test::motion(12.0, {0.2, 1.0, 0.4}, {5.0, -3.0, 8.0}); }
    [[nodiscard]] Volume field() const { return displacement_fixed_to_moving(deformation, output); }
    [[nodiscard]] GpuWarp gpu(const Volume& image, const GpuWarpOptions& options = {}) const {
        return {deformation.mesh, image, output, options};
    }
    [[nodiscard]] Volume warped(GpuWarp& warp) const {
        return warp.warp(deformation.displacement, deformation.placement);
    }
};

double largest_difference(const Volume& a, const Volume& b) {
    return cv::norm(a.voxels, b.voxels, cv::NORM_INF);
}

/// Components of float32 fields that differ by more than that.
std::int64_t count_beyond(double bound, const Volume& a, const Volume& b) {
    std::int64_t count = 0;
    const std::size_t size = a.voxels.total() * static_cast<std::size_t>(a.channels());
    for (std::size_t n = 0; n < size; ++n) count += !(std::abs(a.data<float>()[n] - b.data<float>()[n]) <= bound);
    return count;
}

/// A voxel centre within 1e-4 voxels of the surface of the mesh may fall on either side of it: in the continuation,
/// which the CPU inverts to about 0.01 mm, or in the mesh.
void expect_same_field(const Volume& field, const Volume& expected, double bound) {
    EXPECT_LT(largest_difference(field, expected), 0.02);
    EXPECT_LE(count_beyond(bound, field, expected), 3 + field.geometry.voxel_count() / 20000);
}

std::int64_t count_of_different(const Volume& a, const Volume& b) {
    return cv::countNonZero(cv::Mat(a.voxels != b.voxels).reshape(1, 1));
}

bool same_bits(const Volume& a, const Volume& b) {
    return std::memcmp(a.voxels.data, b.voxels.data, a.voxels.total() * a.voxels.elemSize()) == 0;
}

TEST(GpuWarp, FieldIsThatOfTheCpuInsideAndOutside) {
    // A wrong frame, handedness or barycentric coordinate shows as millimetres.
    const Scene scene;
    const Volume expected = scene.field();
    GpuWarp gpu = scene.gpu(Volume(scene.moving, CV_8UC1));
    gpu.set_continuation(expected, scene.deformation.placement);
    const Volume field = gpu.field(scene.deformation.displacement, scene.deformation.placement);
    EXPECT_TRUE(imaging::same_grid(field.geometry, scene.output));
    expect_same_field(field, expected, 2e-5);
    EXPECT_EQ(gpu.report().inverted, 0);
    EXPECT_EQ(gpu.report().flat, 0);
}

TEST(GpuWarp, ImageIsThatOfTheCpu) {
    // Noise of 0 … 1000 from voxel to voxel: a sample 1e-5 voxels off differs by 0.01.
    const Scene scene;
    const Volume image = noise(scene.moving, CV_32FC1), field = scene.field();
    GpuWarp gpu = scene.gpu(image, {.outside = -5.0});
    gpu.set_continuation(field, scene.deformation.placement);
    const Volume expected = warp_image(image, field, -5.0), warped = scene.warped(gpu);
    EXPECT_LT(largest_difference(warped, expected), 0.05);
    // The scene holds both: tissue from beyond the image, and tissue from within.
    const auto beyond = cv::countNonZero(cv::Mat(expected.voxels == -5.0F).reshape(1, 1));
    EXPECT_GT(beyond, 1000);
    EXPECT_LT(beyond, scene.output.voxel_count() / 2);
    EXPECT_EQ(cv::countNonZero(cv::Mat(warped.voxels == -5.0F).reshape(1, 1)), beyond);
}

TEST(GpuWarp, ImagesOfIntegersAreRoundedAsOnTheCpu) {
    const Scene scene;
    const Volume field = scene.field();
    for (const int type : {CV_8UC1, CV_8SC1, CV_16UC1, CV_16SC1}) {
        const Volume image = noise(scene.moving, type);
        GpuWarp gpu = scene.gpu(image, {.outside = -3.0});  // becomes 0 where the type has no sign
        gpu.set_continuation(field, scene.deformation.placement);
        const Volume expected = warp_image(image, field, -3.0), warped = scene.warped(gpu);
        ASSERT_EQ(warped.voxels.type(), type);
        // A value at a half may go to either side.
        EXPECT_LE(largest_difference(warped, expected), 1.0) << type;
        EXPECT_LE(count_of_different(warped, expected), scene.output.voxel_count() / 1000) << type;
    }
}

TEST(GpuWarp, LabelsKeepAllTheirBits) {
    const Scene scene;
    Volume labels(scene.moving, CV_32SC1);
    for_each_voxel(labels, [&](const Eigen::Vector3d& index, std::int64_t n) {
        labels.data<std::int32_t>()[n] = 900000001 + static_cast<std::int32_t>(index.sum());
    });
    const Volume field = scene.field();
    GpuWarp gpu = scene.gpu(labels, {.interpolation = Interpolation::Nearest});
    gpu.set_continuation(field, scene.deformation.placement);
    const Volume expected = warp_labels(labels, field), warped = scene.warped(gpu);
    ASSERT_EQ(warped.voxels.type(), CV_32SC1);
    EXPECT_LE(count_of_different(warped, expected), scene.output.voxel_count() / 1000);  // halfway between voxels
}

TEST(GpuWarp, RepeatsItselfBitByBit) {
    // Without the lowest element's right the owner of a voxel in a fold would be whichever lane came last.
    Scene scene;
    scene.deformation.displacement.col(scene.deformation.mesh.node_count() / 2) += Eigen::Vector3d(9.0, 7.0, -6.0);
    const Volume image = noise(scene.moving, CV_32FC1);
    GpuWarp gpu = scene.gpu(image), other = scene.gpu(image);
    const Volume first = scene.warped(gpu);
    EXPECT_GT(gpu.report().inverted, 0);
    for (int repeat = 0; repeat < 3; ++repeat) EXPECT_TRUE(same_bits(scene.warped(gpu), first));
    EXPECT_TRUE(same_bits(scene.warped(other), first));
}

TEST(GpuWarp, FoldedElementsBelongToTheLowestAsOnTheCpu) {
    Scene scene;
    scene.deformation.displacement.col(scene.deformation.mesh.node_count() / 2) += Eigen::Vector3d(9.0, 7.0, -6.0);
    const Volume expected = scene.field();
    GpuWarp gpu = scene.gpu(Volume(scene.moving, CV_8UC1));
    gpu.set_continuation(expected, scene.deformation.placement);
    const Volume field = gpu.field(scene.deformation.displacement, scene.deformation.placement);
    expect_same_field(field, expected, 1e-4);
    const int inverted = static_cast<int>(
        (meshing::tet_volumes({scene.deformation.deformed_nodes(), scene.deformation.mesh.tets, {}}).array() < 0)
            .count());
    EXPECT_GT(inverted, 0);
    EXPECT_EQ(gpu.report().inverted, inverted);
}

TEST(GpuWarp, FlatElementsAreCountedAndHoldNoVoxel) {
    // A node of the first element goes to the middle of the opposite face. A division by the volume would show as NaN.
    Deformation deformation = test::deformed_by(test::box_at({0, 0, 0}, {8, 8, 8}, {1, 1, 1}),
                                                [](const auto&) { return Eigen::Vector3d(0.3, 0.4, 0.5); });
    const Eigen::Vector4i corner = deformation.mesh.tets.col(0);
    const Eigen::Matrix3Xd deformed = deformation.deformed_nodes();
    const Eigen::Vector3d middle = (deformed.col(corner[0]) + deformed.col(corner[2]) + deformed.col(corner[3])) / 3.0;
    deformation.displacement.col(corner[1]) = middle - deformation.mesh.nodes.col(corner[1]);
    const Geometry grid = test::plain_grid({11, 11, 11}, 1.0, {-0.71, -0.64, -0.53});
    GpuWarp gpu(deformation.mesh, Volume(grid, CV_8UC1), grid);
    const Volume expected = displacement_fixed_to_moving(deformation, grid);
    gpu.set_continuation(expected);
    expect_same_field(gpu.field(deformation.displacement), expected, 1e-4);
    EXPECT_EQ(gpu.report().flat, 1);
}

TEST(GpuWarp, RasterisationLeavesNoHole) {
    // Voxel centres on nodes, edges and faces, where rounding could lose them between elements. Without a continuation
    // a hole shows zero.
    for (const double jitter : {0.0, 0.12}) {
        const meshing::TetMesh mesh = test::box_at({4, 4, 4}, {24, 24, 24}, {8, 8, 8}, jitter);
        const Eigen::Vector3d shift(1.0, -2.0, 3.0);
        const Deformation deformation = test::deformed_by(mesh, [&](const auto&) { return shift; });
        const Geometry grid = test::plain_grid({33, 33, 33});
        GpuWarp gpu(mesh, Volume(grid, CV_8UC1), grid);
        const Volume field = gpu.field(deformation.displacement);
        for_each_voxel(field, [&](const Eigen::Vector3d& index, std::int64_t n) {
            const Eigen::Array3d X = index - shift;
            const bool inside = (X >= 4.0).all() && (X <= 28.0).all();
            const Eigen::Vector3d expected = inside ? Eigen::Vector3d(-shift) : Eigen::Vector3d::Zero();
            ASSERT_LT((vector_at(field, n) - expected).norm(), 1e-5) << index.transpose() << ", jitter " << jitter;
        });
    }
}

TEST(GpuWarp, ElementsOfVeryDifferentSizeAreDrawnWhole) {
    // One cell across the grid beside cells of a voxel: large elements go in portions, of which none may be lost.
    std::vector<double> graded{-2.0, 0.3, 1.4, 2.6, 90.0};
    meshing::TetMesh mesh = meshing::box_mesh({graded, graded, graded});
    const Deformation deformation = test::deformed_by(mesh, [](const Eigen::Vector3d& X) {
        return Eigen::Vector3d(0.1 * X[1] + 1.0, 0.02 * X[2], -0.05 * X[0] - 0.3);
    });
    const Geometry grid = test::plain_grid({80, 80, 80});
    GpuWarp gpu(mesh, Volume(grid, CV_8UC1), grid);
    const Volume expected = displacement_fixed_to_moving(deformation, grid);
    gpu.set_continuation(expected);
    expect_same_field(gpu.field(deformation.displacement), expected, 5e-5);
    GpuWarp bare(mesh, Volume(grid, CV_8UC1), grid);  // no continuation stands in for what was lost
    const Volume field = bare.field(deformation.displacement);
    int moved = 0;
    for_each_voxel(field, [&](const Eigen::Vector3d&, std::int64_t n) { moved += vector_at(field, n).norm() > 1e-3; });
    EXPECT_GT(moved, 0.9 * static_cast<double>(grid.voxel_count()));
}

TEST(GpuWarp, OutsideFollowsThePlacementAloneUntilAContinuationIsGiven) {
    const Scene scene;
    GpuWarp gpu = scene.gpu(Volume(scene.moving, CV_8UC1));
    const Volume bare = gpu.field(scene.deformation.displacement, scene.deformation.placement);
    const Volume continued = scene.field();
    gpu.set_continuation(continued, scene.deformation.placement);
    const Volume with = gpu.field(scene.deformation.displacement, scene.deformation.placement);
    const Eigen::Isometry3d back = scene.deformation.placement.inverse();
    int outside = 0;
    for_each_voxel(bare, [&](const Eigen::Vector3d& index, std::int64_t n) {
        if ((vector_at(bare, n) - vector_at(with, n)).norm() < 1e-4) return;
        ++outside;
        const Eigen::Vector3d y = scene.output.point(index);
        ASSERT_LT((vector_at(bare, n) - (back * y - y)).norm(), 2e-5);
    });
    EXPECT_GT(outside, 10000);
}

TEST(GpuWarp, ALaterPlacementMovesTheContinuationAlong) {
    const Scene scene;
    GpuWarp gpu = scene.gpu(Volume(scene.moving, CV_8UC1));
    gpu.set_continuation(scene.field(), scene.deformation.placement);
    const Eigen::Vector3d step(0.4, -0.2, 0.3);
    Eigen::Isometry3d later = scene.deformation.placement;
    later.pretranslate(step);
    const Eigen::Matrix3Xd at_rest = Eigen::Matrix3Xd::Zero(3, scene.deformation.mesh.node_count());
    const Volume before = gpu.field(at_rest, scene.deformation.placement), after = gpu.field(at_rest, later);
    const Eigen::Vector3d expected = -(scene.deformation.placement.linear().transpose() * step);
    const Eigen::Vector3d far = vector_at(after, 0) - vector_at(before, 0);  // the first voxel lies outside the mesh
    EXPECT_LT((far - expected).norm(), 1e-4);
}

TEST(GpuWarp, UsesTheMemoryOfAnEarlierResultAgain) {
    const Scene scene;
    const Volume image = noise(scene.moving, CV_32FC1);
    GpuWarp gpu = scene.gpu(image);
    Volume result = scene.warped(gpu);
    const Volume first = result.clone();
    const auto* memory = result.data<float>();
    result.voxels.setTo(0);
    gpu.warp(scene.deformation.displacement, scene.deformation.placement, result);
    EXPECT_EQ(result.data<float>(), memory);
    EXPECT_TRUE(same_bits(result, first));
}

TEST(GpuWarp, AcceptsASingleSlice) {
    const auto in_plane = [](const Eigen::Vector3d& X) { return Eigen::Vector3d(0.1 * X[1], 1.3 - 0.05 * X[0], 0.0); };
    const Deformation deformation =
        test::deformed_by(test::box_at({-20, -15, -10}, {40, 30, 20}, {8, 6, 4}, 0.15), in_plane);
    const Geometry slice = test::plain_grid({61, 51, 1}, 1.0, {-30.2, -25.3, 0.1});
    const Volume image = noise(slice, CV_32FC1), field = displacement_fixed_to_moving(deformation, slice);
    GpuWarp gpu(deformation.mesh, image, slice);
    gpu.set_continuation(field);
    const Volume expected = warp_image(image, field);
    EXPECT_GT(cv::countNonZero(expected.voxels.reshape(1, 1)), 1000);
    EXPECT_LT(largest_difference(gpu.warp(deformation.displacement), expected), 0.05);
}

TEST(GpuWarp, OfARealHeadIsThatOfTheCpu) {
    const std::filesystem::path folder = tissuewarp::test::source_folder() / "data/brainshift";
    const Volume image = imaging::read_volume(folder / "preop.nii.gz");
    const Volume labels = imaging::read_labels(folder / "preop_labels.nii.gz");
    Geometry coarse = labels.geometry;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        coarse.size[axis] = (labels.geometry.size[axis] + 1) / 2;
        coarse.spacing[static_cast<Eigen::Index>(axis)] *= 2.0;
    }
    const meshing::TetMesh mesh =
        meshing::mesh_labels(imaging::resample(labels, coarse, Interpolation::Nearest), {.edge_length = 14.0});
    const Eigen::Vector3d centre = mesh.nodes.rowwise().mean();
    Deformation deformation = test::deformed_by(
        mesh, [&](const Eigen::Vector3d& X) { return Eigen::Vector3d(2.0 * smooth_displacement(0.3 * (X - centre))); });
    deformation.placement = test::motion(4.0, {0.3, -0.2, 1.0}, {2.0, 1.0, -3.0});
    const Volume field = displacement_fixed_to_moving(deformation, coarse);

    GpuWarp grey(mesh, image, coarse);
    grey.set_continuation(field, deformation.placement);
    expect_same_field(grey.field(deformation.displacement, deformation.placement), field, 5e-5);
    const Volume warped = grey.warp(deformation.displacement, deformation.placement);
    const Volume expected = warp_image(image, field);
    EXPECT_LE(largest_difference(warped, expected), 1.0);
    EXPECT_LT(count_of_different(warped, expected), coarse.voxel_count() / 1000);

    GpuWarp nearest(mesh, labels, coarse, {.interpolation = Interpolation::Nearest});
    nearest.set_continuation(field, deformation.placement);
    EXPECT_LT(
        count_of_different(nearest.warp(deformation.displacement, deformation.placement), warp_labels(labels, field)),
        coarse.voxel_count() / 10000);
}

TEST(GpuWarpCheck, RefusesADeviceThatComputesSomethingElse) {
    // A device that warps another mesh or another image than it was given stands for one that computes wrongly.
    const Scene scene;
    const Volume image = noise(scene.moving, CV_32FC1), other_image = noise(scene.moving, CV_8UC1).as(CV_32F);
    meshing::TetMesh other_mesh = scene.deformation.mesh;
    other_mesh.nodes.row(0) *= 1.02;
    GpuWarp gpu = scene.gpu(image);
    EXPECT_NO_THROW(detail::require_right(gpu, scene.deformation.mesh, image, scene.output, {}));
    const auto refusal = [&](const meshing::TetMesh& mesh, const Volume& moving) -> std::string {
        try {
            detail::require_right(gpu, mesh, moving, scene.output, {});
        } catch (const GpuUnavailable& error) {
            return error.what();
        }
        return "";
    };
    EXPECT_THAT(refusal(other_mesh, image), HasSubstr("computes another field than the CPU"));
    EXPECT_THAT(refusal(scene.deformation.mesh, other_image), HasSubstr("computes another image than the CPU"));
}

TEST(GpuWarp, RefusesMeshesAndImagesThatItCannotUse) {
    const Scene scene;
    const Volume image(scene.moving, CV_8UC1);
    const auto make = [&](const meshing::TetMesh& mesh, const Volume& moving, const Geometry& output,
                          Interpolation interpolation = Interpolation::Linear) {
        const GpuWarp warp(mesh, moving, output, {.interpolation = interpolation});
    };
    const meshing::TetMesh& mesh = scene.deformation.mesh;
    meshing::TetMesh inverted = mesh;
    inverted.tets.row(0).swap(inverted.tets.row(1));
    EXPECT_THROW(make(inverted, image, scene.output), InvalidInput);
    EXPECT_THROW(make({}, image, scene.output), InvalidInput);
    EXPECT_THROW(make(mesh, Volume(), scene.output), InvalidInput);
    EXPECT_THROW(make(mesh, image, Geometry{}), InvalidInput);
    EXPECT_THROW(make(mesh, Volume(scene.moving, CV_32FC3), scene.output), InvalidInput);
    Volume broken(scene.moving, CV_32FC1);
    broken.data<float>()[1000] = std::numeric_limits<float>::infinity();
    EXPECT_THROW(make(mesh, broken, scene.output), InvalidInput);
    EXPECT_THROW(make(mesh, Volume(scene.moving, CV_64FC1), scene.output), InvalidInput);
    EXPECT_THROW(make(mesh, Volume(scene.moving, CV_32SC1), scene.output), InvalidInput);
    EXPECT_THROW(make(mesh, Volume(scene.moving, CV_32FC1), scene.output, Interpolation::Nearest), InvalidInput);
}

TEST(GpuWarp, RefusesAGridThatTheDeviceDoesNotHold) {
    const Scene scene;
    const Geometry huge = test::plain_grid({3000, 3000, 3000});
    try {
        const GpuWarp warp(scene.deformation.mesh, Volume(scene.moving, CV_8UC1), huge);
        FAIL() << "accepted";
    } catch (const GpuUnavailable& error) {
        EXPECT_THAT(error.what(), HasSubstr("output grid has 27000000000 voxels"));
        EXPECT_THAT(error.what(), HasSubstr("coarser grid"));
    }
}

TEST(GpuWarp, RefusesDisplacementsAndFieldsThatItCannotUse) {
    const Scene scene;
    GpuWarp gpu = scene.gpu(Volume(scene.moving, CV_8UC1));
    Eigen::Matrix3Xd displacement = scene.deformation.displacement;
    displacement(1, 7) = std::nan("");
    EXPECT_THROW((void)gpu.warp(displacement), InvalidInput);
    EXPECT_THROW((void)gpu.field(displacement.leftCols(5)), InvalidInput);
    Eigen::Isometry3d placement = Eigen::Isometry3d::Identity();
    placement.translation()[0] = std::numeric_limits<double>::infinity();
    EXPECT_THROW((void)gpu.warp(scene.deformation.displacement, placement), InvalidInput);

    EXPECT_THROW(gpu.set_continuation(Volume()), InvalidInput);
    EXPECT_THROW(gpu.set_continuation(Volume(scene.output, CV_32FC1)), InvalidInput);
    EXPECT_THROW(gpu.set_continuation(Volume(scene.moving, CV_32FC3)), InvalidInput);
    Volume field(scene.output, CV_32FC3);
    field.data<cv::Vec3f>()[100][1] = std::numeric_limits<float>::quiet_NaN();
    EXPECT_THROW(gpu.set_continuation(field), InvalidInput);
}

}  // namespace
}  // namespace tissuewarp::registration
