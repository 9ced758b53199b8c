/// What is said against registrations to label maps that are wrong, and nothing against those that are right.
#include "registration/terms/label_doubts.hpp"

#include "registration/update.hpp"
#include "tests/registration/doubt_codes.hpp"
#include "tests/support/label_shapes.hpp"
#include "tests/support/numbers.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <functional>

namespace tissuewarp::registration {
namespace {

using detail::LabelBoundaries;
using Eigen::Vector3d;
using imaging::Volume;
using testing::Contains;
using testing::IsEmpty;
using testing::Not;

/// An organ of which no two sides are alike: an egg with two balls of different size.
int label_at(const Vector3d& x) {
    const Vector3d scaled = x.cwiseQuotient(Vector3d(38 - 0.15 * x[1], 28 + 0.2 * x[0], 22 + 0.12 * x[0]));
    if (scaled.squaredNorm() > 1) return 0;
    if ((x - Vector3d(16, 6, 4)).norm() < 9) return 2;
    return (x - Vector3d(-14, -7, 3)).norm() < 7 ? 3 : 1;
}

/// The organ where `back` takes points of the map to points of the organ, on 2 mm voxels.
Volume map_of(const std::function<Vector3d(const Vector3d&)>& back, const std::array<int, 3>& size = {60, 50, 40}) {
    imaging::Geometry grid;
    grid.size = size;
    grid.spacing.setConstant(2);
    grid.origin = {-59, -49, -39};
    Volume labels(grid, CV_32SC1);
    for (int k = 0; k < size[2]; ++k)
        for (int j = 0; j < size[1]; ++j)
            for (int i = 0; i < size[0]; ++i)
                labels.data<std::int32_t>()[labels.offset(i, j, k)] =
                    label_at(back(grid.point({1.0 * i, 1.0 * j, 1.0 * k})));
    return labels;
}

Vector3d as_it_is(const Vector3d& x) {
    return x;
}

std::function<Vector3d(const Vector3d&)> moved_by(double angle_deg, const Vector3d& axis, const Vector3d& shift) {
    return [back = shapes::motion(angle_deg, axis, shift).inverse()](const Vector3d& x) { return Vector3d(back * x); };
}

Volume renumbered(const Volume& labels, const std::function<int(int)>& number) {
    Volume result = labels.clone();
    std::transform(labels.data<int>(), labels.data<int>() + labels.geometry.voxel_count(), result.data<int>(), number);
    return result;
}

const PreparedModel& model() {
    static const PreparedModel prepared = [] {
        PrepareOptions options;
        options.meshing.edge_length = 8;
        return prepare(map_of(as_it_is), options);
    }();
    return prepared;
}

UpdateOptions on_cpu() {
    UpdateOptions options;
    options.device = Device::Cpu;
    return options;
}

auto said_of(const Volume& fixed, const UpdateResult& result) {
    LabelBoundaries moving(model().labels), seen(fixed);
    return test::codes(detail::doubts_of_labels(model(), moving, seen, on_cpu(), result));
}

std::vector<std::string> doubts_of(const Volume& fixed) {
    return test::codes(update(model(), {.labels = fixed}, on_cpu()).doubts);
}

TEST(LabelDoubts, NothingIsSaidAgainstAnOrganThatMovedAndBent) {
    EXPECT_THAT(doubts_of(map_of(as_it_is)), IsEmpty());
    EXPECT_THAT(doubts_of(map_of(moved_by(12, {1, 2, -1}, {6, -4, 3}))), IsEmpty());
    EXPECT_THAT(doubts_of(map_of([](const Vector3d& x) { return Vector3d(x[0], x[1] - x[0] * x[0] / 250, x[2]); })),
                IsEmpty());
}

// However one map is turned, its pose is found or the result is doubted.
TEST(LabelDoubts, NoTurnEndsInAWrongPoseThatIsNotDoubted) {
    tissuewarp::test::Numbers numbers(41);
    int found = 0, doubted = 0;
    for (int n = 0; n < 12; ++n) {
        const auto turn = shapes::motion(40 + 12 * n, numbers.direction(), 5 * numbers.in_cube());
        const UpdateResult result =
            update(model(),
                   {.labels = map_of([&](const Vector3d& x) -> Vector3d { return turn.inverse() * x; }, {60, 60, 60})},
                   on_cpu());
        const Eigen::Matrix3Xd& nodes = model().model.mesh.nodes;
        const bool right = (result.deformation.deformed_nodes() - turn * nodes).colwise().norm().maxCoeff() < 0.85;
        found += right;
        doubted += count_of_severe(result.doubts) > 0;
        EXPECT_TRUE(right || count_of_severe(result.doubts) > 0) << "turned by " << 40 + 12 * n << "°";
    }
    EXPECT_GE(found, 11);
    EXPECT_LE(doubted, 1);
}

TEST(LabelDoubts, AMapTurnedByFarIsSaidToBe) {
    const Volume fixed = map_of(moved_by(180, Vector3d::UnitX(), Vector3d::Zero()));
    UpdateResult result;
    const meshing::TetMesh& mesh = model().model.mesh;
    result.deformation = {mesh, Eigen::Matrix3Xd::Zero(3, mesh.node_count()), Eigen::Isometry3d::Identity()};
    EXPECT_THAT(said_of(fixed, result), Contains("labels.turned"));
}

TEST(LabelDoubts, AMirroredMapIsSaidToBe) {
    const auto doubts = doubts_of(map_of([](const Vector3d& x) { return Vector3d(x[0], x[1], -x[2]); }));
    EXPECT_THAT(doubts, Contains("labels.mirrored"));
    EXPECT_THAT(doubts, Not(Contains("labels.turned")));
}

TEST(LabelDoubts, ExchangedNumbersAreNamed) {
    const auto fixed = renumbered(map_of(as_it_is), [](int label) { return label == 2 ? 3 : label == 3 ? 2 : label; });
    const UpdateResult result = update(model(), {.labels = fixed}, on_cpu());
    EXPECT_THAT(test::codes(result.doubts), testing::AllOf(Contains("labels.exchanged"), Contains("label.overlap")));
    EXPECT_NE(result.doubts.front().text.find("2 of the moving map lies where 3"), std::string::npos);
}

TEST(LabelDoubts, NumbersExchangedInACycleAreNamed) {
    const Volume moving = map_of(as_it_is),
                 fixed = renumbered(moving, [](int label) { return label ? label % 3 + 1 : 0; });
    const std::string cause = detail::why_nothing_matches(LabelBoundaries(moving), LabelBoundaries(fixed));
    for (const char* part : {"1 of the moving map lies where 2", "2 of the moving map lies where 3",
                             "3 of the moving map lies where 1", "give the same tissue the same number"})
        EXPECT_THAT(cause, testing::HasSubstr(part));
    EXPECT_THAT(detail::why_nothing_matches(LabelBoundaries(moving), LabelBoundaries(moving)),
                testing::HasSubstr("check that the images show"));
}

TEST(LabelDoubts, LabelsOfOneMapAloneAreNamed) {
    const auto gone = renumbered(map_of(as_it_is), [](int label) { return label == 3 ? 1 : label; });
    EXPECT_THAT(doubts_of(gone), Contains("label.vanished"));
    const auto more = renumbered(map_of(as_it_is), [](int label) { return label == 3 ? 7 : label; });
    const UpdateResult result = update(model(), {.labels = more}, on_cpu());
    EXPECT_EQ(std::ranges::count(test::codes(result.doubts), "label.vanished"), 2);
}

TEST(LabelDoubts, AnOrganThatTheImageCutsOffIsSaidToBe) {
    EXPECT_THAT(doubts_of(map_of(as_it_is, {44, 50, 40})), Contains("labels.cut_off"));
    const UpdateResult cut = update(model(), {.labels = map_of(as_it_is, {44, 50, 40})}, on_cpu());
    const Eigen::Matrix3Xd moved = cut.deformation.deformed_nodes() - cut.deformation.mesh.nodes;
    EXPECT_LT(moved.colwise().norm().maxCoeff(), 0.3);  // nothing draws it to the cut: it was 6.05 mm, now 0.21
    const UpdateResult half = update(model(), {.labels = map_of(as_it_is, {34, 50, 40})}, on_cpu());
    const auto volume = std::ranges::find(half.doubts, "labels.volume_changed", &Doubt::code);
    ASSERT_NE(volume, half.doubts.end());
    EXPECT_NE(volume->remedy.find("cuts off"), std::string::npos) << volume->remedy;
}

TEST(LabelDoubts, AVolumeThatTissueDoesNotGiveUpIsSaid) {
    EXPECT_THAT(doubts_of(map_of([](const Vector3d& x) { return Vector3d(x / 0.9); })),
                Contains("labels.volume_changed"));
}

// What a registration that failed leaves behind, whatever made it fail.
TEST(LabelDoubts, TissueThatLiesElsewhereIsSaidLabelByLabel) {
    const Volume fixed = map_of(as_it_is);
    UpdateResult result = update(model(), {.labels = fixed}, on_cpu());
    EXPECT_THAT(said_of(fixed, result), IsEmpty());
    result.deformation.placement.translation() += Vector3d(0, 13, 0);
    const auto doubts = said_of(fixed, result);
    EXPECT_THAT(doubts, testing::AllOf(Contains("label.overlap"), Contains("labels.worse")));
    EXPECT_THAT(doubts, Contains("label.apart"));  // the organ still overlaps by more than half
    result.alignment.mean_distance_mm = 3.5;
    EXPECT_THAT(said_of(fixed, result), Contains("alignment.apart"));
}

}  // namespace
}  // namespace tissuewarp::registration
