/// Organs that change their size freely: the stretch is found, tissue starts from it, and what is said stays true.
#include "registration/stretch/free_stretch.hpp"

#include "registration/stretch/strain_free.hpp"
#include "registration/stretch/stretched_update.hpp"
#include "tests/registration/doubt_codes.hpp"
#include "tests/support/label_shapes.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>

namespace tissuewarp::registration {
namespace {

using Eigen::Affine3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using imaging::Volume;
using testing::Contains;
using testing::Not;

/// A cone of an egg, where `map` takes it, on 3 mm voxels.
Volume egg(const Affine3d& map) {
    imaging::Geometry grid;
    grid.size = {70, 70, 60};
    grid.spacing.setConstant(3);
    grid.origin = {-100, -100, -90};
    Volume labels(grid, CV_32SC1);
    const Affine3d back = map.inverse();
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i) {
                const Vector3d x = back * grid.point({double(i), double(j), double(k)});
                const Vector3d scaled = x.cwiseQuotient(Vector3d(40 - 0.4 * x[2], 35 + 0.15 * x[0] - 0.2 * x[2], 60));
                labels.data<std::int32_t>()[labels.offset(i, j, k)] = scaled.squaredNorm() <= 1;
            }
    return labels;
}

Matrix3d breath() {
    Matrix3d stretch;
    stretch << 0.95, 0.02, 0, 0.02, 0.85, -0.04, 0, -0.04, 0.75;
    return stretch;
}

Affine3d breath_and_shift() {
    return Eigen::Translation3d(6, -12, 15) * Affine3d(breath());
}

UpdateOptions on_cpu() {
    UpdateOptions options;
    options.device = Device::Cpu;
    return options;
}

const Tissue& lung() {
    return tissue_named("lung");
}

const PreparedModel& model() {
    static const PreparedModel prepared = [] {
        PrepareOptions options;
        options.meshing.edge_length = 12;
        options.default_material = tissue_named("lung").material;
        return prepare(egg(Affine3d::Identity()), options);
    }();
    return prepared;
}

detail::FreeStretch stretch_to(const Affine3d& map, double most) {
    const AlignmentOptions alignment;
    return detail::find_free_stretch(egg(Affine3d::Identity()), egg(map), most, &alignment, silent_observer());
}

StretchedUpdate stretched(const Affine3d& map, const Tissue& tissue = lung()) {
    return update_stretched(model(), {.labels = egg(map)}, tissue, on_cpu());
}

/// Mean distance of the nodes from where the map takes them, mm.
double mean_error(const UpdateResult& result, const Affine3d& truth) {
    const Eigen::Matrix3Xd& nodes = result.deformation.mesh.nodes;
    return (result.deformation.deformed_nodes() - truth * nodes).colwise().norm().mean();
}

TEST(FreeStretch, IsFoundFromBoundaries) {
    const auto found = stretch_to(breath_and_shift(), lung().free_stretch);
    EXPECT_LT((found.stretch.linear() - breath()).cwiseAbs().maxCoeff(), 0.02) << found.stretch.matrix();
    const Affine3d whole = found.placement * found.stretch;
    EXPECT_LT((whole * Vector3d(10, 10, 10) - breath_and_shift() * Vector3d(10, 10, 10)).norm(), 1.0);
    EXPECT_LT(found.mean_distance_mm, 1.0);
}

// An organ that is turned and halved at once is not found: alignment is rigid.
TEST(FreeStretch, FollowsATurnThatAlignmentFinds) {
    const Affine3d turn(shapes::motion(170, {1, 0.2, 0.1}, {5, 0, 0}).matrix());
    const Affine3d turned = turn * Eigen::Scaling(Vector3d(0.97, 0.94, 0.9));
    const auto found = stretch_to(turned, lung().free_stretch);
    const Affine3d whole = found.placement * found.stretch;
    EXPECT_LT((whole.linear() - turned.linear()).norm(), 0.2) << whole.matrix() << "\n" << turned.matrix();
}

TEST(FreeStretch, StaysWithinWhatTissueTakesUp) {
    const auto found = stretch_to(breath_and_shift(), 0.1);
    EXPECT_GT(found.stretch.linear().determinant(), std::exp(-0.5));
}

TEST(FreeStretch, TissueGoesWithIt) {
    const StretchedUpdate found = stretched(breath_and_shift());
    const UpdateResult& result = found.result;
    EXPECT_LT(mean_error(result, breath_and_shift()), 1.0);
    EXPECT_TRUE(result.deformation.mesh.nodes.isApprox(model().model.mesh.nodes));
    EXPECT_NEAR(found.stretch.linear().determinant(), breath().determinant(), 0.02);
    EXPECT_NEAR(result.min_jacobian, breath().determinant(), 0.15);
    const UpdateResult strained = update(model(), {.labels = egg(breath_and_shift())}, on_cpu());
    EXPECT_GT(mean_error(strained, breath_and_shift()), 2 * mean_error(result, breath_and_shift()));
}

TEST(FreeStretch, AnOrganThatDidNotChangeStaysAsItIs) {
    EXPECT_LT(mean_error(stretched(Affine3d::Identity()).result, Affine3d::Identity()), 0.5);
}

TEST(FreeStretch, ErrorsAreEstimatedFromTheStrainFreeShape) {
    const StretchedUpdate found = stretched(breath_and_shift());
    const Uncertainty estimate = uncertainty(found);
    EXPECT_TRUE(estimate.mesh().nodes.isApprox(model().model.mesh.nodes));
    EXPECT_LT(std::sqrt(estimate.nodal().data.mean()), 30);
    // what the stretch moved far is known no better than by a share of that, along all axes alike
    const Eigen::RowVectorXd moved = found.result.deformation.displacement.colwise().norm();
    const Eigen::RowVectorXd least = stretch_errors.share * moved;
    EXPECT_GT(least.maxCoeff(), 0.5);
    EXPECT_TRUE((estimate.nodal().data.array().sqrt() > least.array()).all());
    EXPECT_TRUE((estimate.nodal().covariance.row(2).array() > least.array().square() / 3).all());
}

TEST(FreeStretch, AVolumeBeyondWhatALungGivesUpIsDoubted) {
    Tissue stiff = lung();
    stiff.most_growth = 1.5;
    EXPECT_THAT(test::codes(stretched(breath_and_shift(), stiff).result.doubts), Contains("labels.volume_changed"));
    EXPECT_THAT(test::codes(stretched(breath_and_shift()).result.doubts), Not(Contains("labels.volume_changed")));
}

TEST(FreeStretch, TakesLabelsAloneAndTissueThatHasOne) {
    const Intraoperative labels{.labels = egg(breath_and_shift())};
    EXPECT_TRUE(stretches_freely(model(), labels, lung()));
    EXPECT_FALSE(stretches_freely(model(), labels, tissue_named("liver")));
    Intraoperative more = labels;
    more.points = PointPairs{Eigen::Matrix3Xd::Zero(3, 4), Eigen::Matrix3Xd::Zero(3, 4)};
    EXPECT_FALSE(stretches_freely(model(), more, lung()));
}

TEST(StrainFree, TurnsNoTissueInsideOut) {
    Affine3d mirror = Affine3d::Identity();
    mirror.linear()(0, 0) = -1;
    EXPECT_THROW(detail::strain_free_under(model(), mirror, silent_observer()), InvalidInput);
}

TEST(StrainFree, CarriesOffsetsOfTheBoundaryAlong) {
    const Affine3d map(Matrix3d(Vector3d(1, 1, 0.5).asDiagonal()));
    const PreparedModel flat = detail::strain_free_under(model(), map, silent_observer());
    const auto& before = model().interfaces.nodes();
    const auto& after = flat.interfaces.nodes();
    ASSERT_EQ(before.size(), after.size());
    for (std::size_t i = 0; i < before.size(); ++i) {
        ASSERT_EQ(before[i].node, after[i].node);
        if (std::abs(before[i].normal.z()) < 0.999) continue;
        EXPECT_NEAR(after[i].offset, 0.5 * before[i].offset, 0.01 * std::abs(before[i].offset) + 1e-9);
    }
}

TEST(Tissues, AreNamedOnceAndHaveSources) {
    std::set<std::string> names;
    for (const Tissue& tissue : tissues()) {
        EXPECT_TRUE(names.insert(tissue.name).second) << tissue.name;
        EXPECT_FALSE(tissue.source.empty()) << tissue.name;
        EXPECT_GT(tissue.most_growth, 1) << tissue.name;
    }
    for (const char* name : {"lung", "brain", "liver", "prostate", "breast", "kidney", "muscle", "default"})
        EXPECT_TRUE(names.contains(name)) << name;
}

TEST(Tissues, TheDefaultIsThatOfModels) {
    const tled::Material of_models = PrepareOptions().default_material;
    EXPECT_DOUBLE_EQ(tled::poisson_ratio(tissue_named("default").material), tled::poisson_ratio(of_models));
    EXPECT_DOUBLE_EQ(tled::shear_modulus(tissue_named("default").material), tled::shear_modulus(of_models));
    EXPECT_EQ(tissue_named("default").free_stretch, 0);
    UpdateOptions options;
    expect_motion_of(tissue_named("default"), options);
    EXPECT_EQ(options.tissue.expected_strain, TissuePrior().expected_strain);
    EXPECT_EQ(options.image.matching.search_mm, BlockMatchingOptions().search_mm);
}

TEST(Tissues, OfALungMoreAndFartherMotionIsExpected) {
    UpdateOptions options;
    expect_motion_of(tissue_named("lung"), options);
    EXPECT_EQ(options.tissue.expected_strain, tissue_named("lung").expected_strain);
    EXPECT_GT(options.tissue.expected_strain, 2 * TissuePrior().expected_strain);
    EXPECT_EQ(options.image.matching.search_mm, 32);
}

TEST(Tissues, AnUnknownNameIsRefusedWithThoseThereAre) {
    try {
        (void)tissue_named("spleen");
        FAIL();
    } catch (const InvalidInput& error) {
        EXPECT_THAT(error.what(), testing::AllOf(testing::HasSubstr("spleen"), testing::HasSubstr("lung")));
    }
}

}  // namespace
}  // namespace tissuewarp::registration
