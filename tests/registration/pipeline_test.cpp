/// The method as a whole on a small organ.
#include "registration/update.hpp"

#include "registration/evaluation.hpp"
#include "registration/field.hpp"
#include "tests/support/label_shapes.hpp"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

namespace tissuewarp::registration {
namespace {

using shapes::organ_labels;

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

double largest(const Eigen::Matrix3Xd& x) {
    return std::sqrt(x.colwise().squaredNorm().maxCoeff());
}

TEST(Pipeline, AnImageRegisteredToItselfDoesNotMove) {
    const auto labels = organ_labels({});
    UpdateOptions options = on_cpu();
    options.align = false;
    const auto result = update(prepare(labels, coarse()), {.labels = labels}, options);
    EXPECT_LT(largest(result.deformation.displacement), 1e-3);
    EXPECT_TRUE(result.doubts.empty());
}

TEST(Pipeline, ARigidMotionIsFoundWithoutStrain) {
    const auto truth = shapes::motion(12, {1, 1, 0}, {6, -4, 5});
    const auto prepared = prepare(organ_labels({}), coarse());
    const auto result = update(prepared, {.labels = organ_labels({}, truth)}, on_cpu());
    const Eigen::Matrix3Xd expected = truth * prepared.model.mesh.nodes;
    const Eigen::Matrix3Xd error = result.deformation.deformed_nodes() - expected;
    EXPECT_LT(std::sqrt(error.colwise().squaredNorm().mean()), 0.323);  // voxels of 1.5 mm
    EXPECT_GT(result.min_jacobian, 0.9);
}

TEST(Pipeline, AnOrganPressedFlatIsFollowed) {
    shapes::Organ pressed;
    pressed.semi_axes = {47.5, 36.5, 27.5};  // 8 % thinner, wider, of nearly the same volume
    pressed.inclusion =
        shapes::Organ{}.inclusion.cwiseProduct(pressed.semi_axes).cwiseQuotient(shapes::Organ{}.semi_axes);
    UpdateOptions options = on_cpu();
    options.align = false;
    const auto prepared = prepare(organ_labels({}), coarse());
    const auto result = update(prepared, {.labels = organ_labels(pressed)}, options);
    const Eigen::Vector3d stretch = pressed.semi_axes.cwiseQuotient(shapes::Organ{}.semi_axes);
    const Eigen::Matrix3Xd error =
        result.deformation.deformed_nodes() - stretch.asDiagonal() * prepared.model.mesh.nodes;
    EXPECT_LT(error.colwise().norm().mean(), 0.46);
    EXPECT_LT(result.rounds.back().mean_residual_mm, 0.077);
    EXPECT_EQ(mesh_jacobians(result.deformation).folded, 0);
}

/// The share of the interface nodes that are matched, and their mean distance from the boundary, after many rounds.
Round after_many_rounds(const PreparedModel& prepared, const imaging::Volume& labels) {
    UpdateOptions options = on_cpu();
    options.align = false;
    options.rematches = 32;
    options.settled_mm = 0;
    options.tissue.load_shapes = 0;
    return update(prepared, {.labels = labels}, options).rounds.back();
}

// An organ of a quarter less volume and nearly incompressible tissue: what tissue resists is not let go of, however
// long the rounds go on. Weights that fall with the distance itself lose 29 % of the boundary here.
TEST(Pipeline, ABoundaryThatTissueResistsIsNotLetGo) {
    shapes::Organ smaller;
    for (Eigen::Vector3d* part : {&smaller.semi_axes, &smaller.inclusion}) *part *= 0.91;
    smaller.inclusion_radius *= 0.91;
    const auto prepared = prepare(organ_labels({}), coarse());
    const Round last = after_many_rounds(prepared, organ_labels(smaller));
    EXPECT_GT(last.matched, 0.98 * last.interface_nodes);
    EXPECT_LT(last.mean_residual_mm, 1.2);
}

// A map that lacks a piece of the organ, 15 mm wide and 4 mm deep, moves what lies about it and nothing else.
TEST(Pipeline, AWrongPieceOfALabelMapStaysLocal) {
    auto labels = organ_labels({});
    const Eigen::Vector3d top(0, 0, shapes::Organ{}.semi_axes[2]);
    auto wrong = labels;
    wrong.voxels = labels.voxels.clone();
    for (int k = 0; k < wrong.geometry.size[2]; ++k)
        for (int j = 0; j < wrong.geometry.size[1]; ++j)
            for (int i = 0; i < wrong.geometry.size[0]; ++i) {
                const Eigen::Vector3d x = wrong.geometry.point({double(i), double(j), double(k)}) - top;
                if (x.head<2>().norm() < 7.5 && x[2] > -4) wrong.data<std::int32_t>()[wrong.offset(i, j, k)] = 0;
            }
    UpdateOptions options = on_cpu();
    options.align = false;
    const auto result = update(prepare(labels, coarse()), {.labels = wrong}, options);
    const auto& deformation = result.deformation;
    for (Eigen::Index n = 0; n < deformation.displacement.cols(); ++n) {
        if ((deformation.mesh.nodes.col(n) - top).norm() < 30) continue;
        EXPECT_LT(deformation.displacement.col(n).norm(), 0.3);
    }
    EXPECT_LT(std::sqrt(deformation.displacement.colwise().squaredNorm().mean()), 0.377);
}

TEST(Pipeline, SameBitsForOneThreadAndMany) {
    const auto moving = organ_labels({}), fixed = organ_labels({}, shapes::motion(5, {0, 0, 1}, {2, 1, 0}));
    const auto solve = [&](std::size_t threads) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        return update(prepare(moving, coarse()), {.labels = fixed}, on_cpu()).deformation.deformed_nodes();
    };
    const Eigen::Matrix3Xd one = solve(1), two = solve(2);
    ASSERT_EQ(one.cols(), two.cols());
    EXPECT_EQ(one, two);
}

TEST(Pipeline, TheGpuEngineGivesTheSameAnswer) {
    const auto moving = organ_labels({}), fixed = organ_labels({}, shapes::motion(5, {0, 0, 1}, {2, 1, 0}));
    const auto prepared = prepare(moving, coarse());
    UpdateOptions gpu = on_cpu();
    gpu.device = Device::Gpu;
    const Eigen::Matrix3Xd a = update(prepared, {.labels = fixed}, on_cpu()).deformation.displacement;
    const Eigen::Matrix3Xd b = update(prepared, {.labels = fixed}, gpu).deformation.displacement;
    EXPECT_LT(largest(a - b), 0.05);
}

TEST(Pipeline, LabelsWithoutAnythingInCommonAreRefused) {
    const auto prepared = prepare(organ_labels({}), coarse());
    auto fixed = organ_labels({});
    fixed.voxels.setTo(7, fixed.voxels > 0);
    EXPECT_THROW(update(prepared, {.labels = fixed}, on_cpu()), InvalidInput);
}

TEST(Pipeline, StopsWhenAsked) {
    struct Impatient : Observer {
        bool cancel_requested() override { return true; }
    } impatient;
    EXPECT_THROW(prepare(organ_labels({}), coarse(), impatient), Cancelled);
}

}  // namespace
}  // namespace tissuewarp::registration
