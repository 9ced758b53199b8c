/// Each doubt is said just beyond its limit, and not just within.
#include "registration/doubts.hpp"

#include "registration/evaluation.hpp"
#include "registration/springs/ground_springs.hpp"
#include "registration/terms/anchors.hpp"
#include "registration/terms/curves.hpp"
#include "registration/terms/image.hpp"
#include "registration/terms/points.hpp"
#include "registration/terms/surface.hpp"
#include "registration/uncertainty.hpp"
#include "registration/update.hpp"
#include "tests/registration/doubt_codes.hpp"
#include "tests/support/label_shapes.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>

namespace tissuewarp::registration {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::IsEmpty;

template <class... Arguments>
std::vector<std::string> of(const Arguments&... fit) {
    return test::codes(detail::doubts_of(fit...));
}

std::string code(const std::optional<Doubt>& doubt) {
    return doubt ? doubt->code : "";
}

TEST(Doubts, OfImages) {
    const ImageFit good{1000, 101, 0.99, 0.51, 0.26};
    EXPECT_THAT(of(good), IsEmpty());
    ImageFit bad = good;
    bad.matched = 99;
    EXPECT_THAT(of(bad), ElementsAre("image.blocks_lost"));
    bad = good;
    bad.shown_share = 0.49;
    EXPECT_THAT(of(bad), ElementsAre("image.out_of_view"));
    EXPECT_EQ(count_of_severe(detail::doubts_of(bad)), 0);
    bad = good;
    bad.agreement = 0.24;
    EXPECT_THAT(of(bad), ElementsAre("image.disagree"));
    bad.agreement.reset();
    EXPECT_THAT(of(bad), IsEmpty());
    bad = good;
    bad.residual_mm = 1.01;
    EXPECT_THAT(of(bad), ElementsAre("image.apart"));
}

TEST(Doubts, OfRegionsLeftBehind) {
    const auto of_left = [](double distance_mm, double spacing_mm) {
        return of(detail::LeftBehind{distance_mm, {1, 2, 3}}, spacing_mm);
    };
    EXPECT_THAT(of_left(5.0, 2.5), IsEmpty());
    EXPECT_THAT(of_left(5.1, 2.5), ElementsAre("image.left_behind"));
    EXPECT_THAT(of_left(2.0, 0.5), IsEmpty());
    EXPECT_THAT(of_left(2.1, 0.5), ElementsAre("image.left_behind"));
    const auto text = detail::doubts_of(detail::LeftBehind{6, {-1, 2.4, -99.6}}, 1.0).front().text;
    EXPECT_THAT(text, testing::HasSubstr("6.00 mm"));
    EXPECT_THAT(text, testing::HasSubstr("(-1, 2, -100) mm"));
}

TEST(Doubts, OfSurfaces) {
    const SurfaceFit good{0.51, 1.39, 0.26, true, 30, 0.94};
    EXPECT_THAT(of(good, 1.0), IsEmpty());
    SurfaceFit bad = good;
    bad.inlier_share = 0.49;
    EXPECT_THAT(of(bad, 1.0), ElementsAre("surface.outliers"));
    bad = good;
    bad.residual_mm = 1.41;
    EXPECT_THAT(of(bad, 1.0), ElementsAre("surface.apart"));
    EXPECT_THAT(of(bad, 1.1), IsEmpty());
    bad = good;
    bad.coverage = 0.24;
    bad.rival_support = 0.96;
    EXPECT_THAT(of(bad, 1.0), ElementsAre("surface.too_small", "surface.two_poses"));
    bad.pose_searched = false;  // the headers say where it lies
    EXPECT_THAT(of(bad, 1.0), IsEmpty());
}

TEST(Doubts, OfPointsAndCurves) {
    EXPECT_THAT(of(PointFit{10, 2, 1}), IsEmpty());
    EXPECT_THAT(of(PointFit{10, 3, 1}), ElementsAre("points.outliers"));
    EXPECT_THAT(of(CurveFit{100, 0.51, 1.69, 200}, 1.0), IsEmpty());
    EXPECT_THAT(of(CurveFit{100, 0.49, 1.69, 200}, 1.0), ElementsAre("curves.outliers"));
    EXPECT_THAT(of(CurveFit{100, 0.51, 1.71, 200}, 1.0), ElementsAre("curves.apart"));
    EXPECT_THAT(of(CurveFit{100, 0.51, 1.69, 200, 30, 0.94}, 1.0), IsEmpty());
    EXPECT_THAT(of(CurveFit{100, 0.51, 1.69, 200, 30, 0.96}, 1.0), ElementsAre("curves.two_poses"));
}

TEST(Doubts, OfTheCourse) {
    UpdateResult result;
    result.rounds.resize(1);
    result.rounds.back().matched = 1000;
    result.min_jacobian = 0.11;
    EXPECT_THAT(detail::doubts_of_course(result), IsEmpty());
    result.rounds.back().held_back = 500;
    result.cut_short = true;
    result.min_jacobian = 0.09;
    EXPECT_THAT(test::codes(detail::doubts_of_course(result)),
                ElementsAre("rounds.held_back", "rounds.cut_short", "tissue.compressed"));
}

TEST(Doubts, OfFoldsSolverAndAccuracy) {
    JacobianReport report;
    EXPECT_EQ(code(doubt_of_folds(report, report, {})), "");
    EXPECT_EQ(code(doubt_of_folds(report, report, {.left = 1})), "field.folds");
    EXPECT_EQ(doubt_of_folds(report, report, {.left = 1})->text, "the backward field folds in 1 voxels");
    report.folded = 1;
    EXPECT_EQ(code(doubt_of_folds(report, {}, {})), "field.folds");
    EXPECT_EQ(code(doubt_of_unfolding({20, 0, 3, 0.9}, {10, 0, 2, 0.8})), "");
    EXPECT_EQ(code(doubt_of_unfolding({20, 0, 3, 1.1}, {})), "field.unfolded");
    EXPECT_EQ(code(doubt_of_unfolding({20, 0, 3, 0.1}, {20, 0, 3, 1.1})), "field.unfolded");
    EXPECT_EQ(doubt_of_unfolding({20, 0, 3, 1.1, 0, 2900}, {})->severity, Severity::Doubt);
    EXPECT_EQ(doubt_of_unfolding({20, 0, 3, 1.1, 0, 3100}, {})->severity, Severity::Notice);
    UncertaintySummary summary;
    summary.algebraic_mm = 0.051;
    EXPECT_EQ(code(doubt_of_solver(summary, 0.06)), "");
    EXPECT_EQ(code(doubt_of_solver(summary, 0.05)), "solver.short");
    summary.interval_mm = 1.5;
    EXPECT_EQ(code(doubt_of_accuracy(summary, 1.6)), "");
    EXPECT_EQ(code(doubt_of_accuracy(summary, 1.4)), "accuracy.not_sure");
}

TEST(Doubts, OfAnchors) {
    PrepareOptions options;
    options.meshing.edge_length = 10;
    options.anchors = {2};
    const PreparedModel prepared = prepare(shapes::organ_labels({}), options);
    detail::AnchorTerm term(prepared, detail::strain_energy_unit(prepared, {}));
    const auto said = [&](double pulled_mm) {
        const int nodes = prepared.rest.node_count;
        UpdateResult result;
        term.judge({Eigen::Isometry3d::Identity(), Eigen::Vector3d(0, 0, pulled_mm).replicate(1, nodes)}, result);
        EXPECT_NEAR(result.anchors->largest_mm, pulled_mm, 1e-9);
        return test::codes(result.doubts);
    };
    EXPECT_THAT(said(0.49), IsEmpty());
    EXPECT_THAT(said(0.51), ElementsAre("anchors.pulled"));
}

TEST(Doubts, OfBoundariesThatDoNotMeet) {
    PrepareOptions coarse;
    coarse.meshing.edge_length = 9;
    const PreparedModel prepared = prepare(shapes::organ_labels({}), coarse);
    UpdateOptions options;
    options.device = Device::Cpu;
    options.align = false;
    shapes::Organ other;
    other.centre = {9, 0, 0};
    PrepareOptions held = coarse;
    held.anchors = {1};
    EXPECT_THAT(
        test::codes(
            update(prepare(shapes::organ_labels({}), held), {.labels = shapes::organ_labels(other)}, options).doubts),
        Contains("labels.apart"));
    other.centre = {0, 0, 0};
    other.semi_axes = {20, 16, 14};
    EXPECT_THAT(test::codes(update(prepared, {.labels = shapes::organ_labels(other)}, options).doubts),
                Contains("labels.unmatched"));
}

}  // namespace
}  // namespace tissuewarp::registration
