/// Choosing a mesh by what was measured, and keeping a time.
#include "registration/dial/dial.hpp"
#include "core/errors.hpp"
#include "registration/dial/fronts_io.hpp"
#include "registration/update.hpp"
#include "tests/registration/doubt_codes.hpp"
#include "tests/support/label_shapes.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>

namespace tissuewarp::registration {
namespace {

using testing::HasSubstr;

/// Three meshes with labels: 6, 12 and 24 edges an organ take 0.2, 1 and 8 s and leave 1.5, 0.6 and 0.4 mm at most.
Fronts three_meshes() {
    Fronts fronts;
    fronts.machine = "test";
    fronts.measured_here = true;
    fronts.alignment[0] = {0.1, 0.1};
    fronts.fields = {0, 0.05};
    fronts.warp = {0, 0.05};
    for (const auto& [density, seconds, error] : {std::tuple{6.0, 0.2, 1.5}, {12.0, 1.0, 0.6}, {24.0, 8.0, 0.4}}) {
        FrontPoint point;
        point.edges_per_organ = density;
        point.tetrahedra = 15 * density * density * density;
        point.preparation_s = seconds;
        point.rounds_s = seconds / 1.5;
        point.rounds_95_s = seconds;
        point.error_mm = error / 2;
        point.error_95_mm = error;
        fronts.points.push_back(point);
    }
    return fronts;
}

/// Beside its rounds a registration takes 0.2 s before them and 0.15 s after.
DialCase head() {
    return {DataKind::Labels, 120, 1, 1, 1};
}

TEST(Dial, TakesTheFastestMeshThatIsAccurateEnough) {
    EXPECT_DOUBLE_EQ(choose(three_meshes(), {.accuracy_mm = 2, .time_s = {}}, head()).edge_length_mm, 20);
    EXPECT_DOUBLE_EQ(choose(three_meshes(), {.accuracy_mm = 0.7, .time_s = {}}, head()).edge_length_mm, 10);
    const DialChoice fine = choose(three_meshes(), {.accuracy_mm = 0.1, .time_s = {}}, head());
    EXPECT_DOUBLE_EQ(fine.edge_length_mm, 5);
    EXPECT_FALSE(fine.accuracy_met);
    EXPECT_THAT(fine.reason, HasSubstr("not to be expected"));
    EXPECT_EQ(fine.update_budget_s, 0);
}

TEST(Dial, TakesTheMostAccurateMeshThatIsFastEnough) {
    const DialChoice second = choose(three_meshes(), {.accuracy_mm = {}, .time_s = 2}, head());
    EXPECT_DOUBLE_EQ(second.edge_length_mm, 10);
    EXPECT_NEAR(second.update_budget_s, 2 - 0.15, 1e-12);
    EXPECT_NEAR(second.seconds, 0.2 + 1 / 1.5 + 0.15, 1e-12);
    EXPECT_DOUBLE_EQ(choose(three_meshes(), {.accuracy_mm = {}, .time_s = 20}, head()).edge_length_mm, 5);
    const DialChoice late = choose(three_meshes(), {.accuracy_mm = {}, .time_s = 0.3}, head());
    EXPECT_DOUBLE_EQ(late.edge_length_mm, 20);
    EXPECT_FALSE(late.time_met);
    EXPECT_THAT(late.reason, HasSubstr("too short"));
}

TEST(Dial, TakesTheFastestAccurateMeshWithinTheTime) {
    EXPECT_DOUBLE_EQ(choose(three_meshes(), {.accuracy_mm = 2, .time_s = 20}, head()).edge_length_mm, 20);
    const DialChoice both = choose(three_meshes(), {.accuracy_mm = 0.5, .time_s = 2}, head());
    EXPECT_DOUBLE_EQ(both.edge_length_mm, 10);
    EXPECT_FALSE(both.accuracy_met);
}

// Errors that measurements hardly tell apart do not choose the coarsest mesh.
TEST(Dial, TakesTheFinestOfEquallyAccurateMeshes) {
    Fronts fronts = three_meshes();
    for (FrontPoint& point : fronts.points) point.error_95_mm = 2 + 0.002 * point.edges_per_organ;
    EXPECT_DOUBLE_EQ(choose(fronts, {.accuracy_mm = {}, .time_s = 2}, head()).edge_length_mm, 10);
    EXPECT_DOUBLE_EQ(choose(fronts, {.accuracy_mm = {}, .time_s = 20}, head()).edge_length_mm, 5);
    EXPECT_DOUBLE_EQ(choose(fronts, {.accuracy_mm = 3, .time_s = 20}, head()).edge_length_mm, 20);
}

// Without a time, an accuracy that no mesh has is no reason to wait for one that is no more accurate.
TEST(Dial, WaitsForAFinerMeshNoLongerThanTwiceWhereItGainsNothing) {
    Fronts fronts = three_meshes();
    for (FrontPoint& point : fronts.points) point.error_95_mm = 2 + 0.002 * point.edges_per_organ;
    EXPECT_DOUBLE_EQ(choose(fronts, {.accuracy_mm = 1, .time_s = {}}, head()).edge_length_mm, 20);
    fronts.points[1].rounds_s = 0.5;  // 0.85 s with the rest, against 0.48 s
    EXPECT_DOUBLE_EQ(choose(fronts, {.accuracy_mm = 1, .time_s = {}}, head()).edge_length_mm, 10);
    fronts.points[2].error_95_mm = 1.8;
    EXPECT_DOUBLE_EQ(choose(fronts, {.accuracy_mm = 1, .time_s = {}}, head()).edge_length_mm, 5);
}

TEST(Dial, RefusesWhatItCannotChooseBy) {
    EXPECT_THROW(choose(three_meshes(), {}, head()), InvalidInput);
    EXPECT_THROW(choose(three_meshes(), {.accuracy_mm = -1, .time_s = {}}, head()), InvalidInput);
    EXPECT_THROW(choose(three_meshes(), {.accuracy_mm = {}, .time_s = NAN}, head()), InvalidInput);
    DialCase surface = head();
    surface.kind = DataKind::Partial;
    EXPECT_THROW(choose(three_meshes(), {.accuracy_mm = 1, .time_s = {}}, surface), InvalidInput);
}

TEST(Fronts, AreTheSameAfterAFile) {
    const std::string text = to_json_text(three_meshes());
    EXPECT_EQ(to_json_text(fronts_from_json(text, "text")), text);
}

TEST(Fronts, OfAnotherFileAreRefusedByName) {
    const std::string good = to_json_text(three_meshes());
    const auto changed = [&](const std::string& from, const std::string& to) {
        std::string text = good;
        const std::size_t at = text.find(from);
        EXPECT_NE(at, std::string::npos) << from;
        return text.replace(at, from.size(), to);
    };
    for (const std::string& text :
         {std::string("{"), std::string("{}"), changed("tissuewarp.fronts", "other"),
          changed("\"labels\"", "\"image\""), changed("\"rounds_s\": ", "\"rounds_s\": -"),
          changed("\"machine\"", "\"maschine\""), changed("\"edges_per_organ\": 6.0", "\"edges_per_organ\": 1e9")}) {
        try {
            fronts_from_json(text, "my.json");
            ADD_FAILURE() << text;
        } catch (const InvalidInput& error) {
            EXPECT_THAT(error.what(), HasSubstr("my.json"));
        }
    }
}

// The program's own figures can be read and say something of both kinds of data.
TEST(Fronts, ComeWithTheProgram) {
    const Fronts fronts = shipped_fronts();
    EXPECT_FALSE(fronts.measured_here);
    for (const DataKind kind : {DataKind::Labels, DataKind::Partial})
        EXPECT_GE(std::count_if(fronts.points.begin(), fronts.points.end(),
                                [&](const FrontPoint& p) { return p.kind == kind; }),
                  3);
}

// Without time a single round is made and a doubt says so; with plenty the result is that without a budget.
TEST(TimeBudget, EndsTheRoundsAndSaysSo) {
    const auto labels = shapes::organ_labels({});
    PrepareOptions coarse;
    coarse.meshing.edge_length = 9;
    const PreparedModel prepared = prepare(labels, coarse);
    shapes::Organ larger;
    larger.semi_axes *= 1.08;
    const auto fixed = shapes::organ_labels(larger);
    UpdateOptions options;
    options.device = Device::Cpu;
    const UpdateResult free = update(prepared, {.labels = fixed}, options);
    options.time_budget_s = 1e-6;
    const UpdateResult hurried = update(prepared, {.labels = fixed}, options);
    EXPECT_TRUE(hurried.cut_short);
    EXPECT_EQ(hurried.rounds.size(), 1u);
    EXPECT_THAT(test::codes(hurried.doubts), testing::Contains("rounds.cut_short"));
    options.time_budget_s = 1e6;
    const UpdateResult unhurried = update(prepared, {.labels = fixed}, options);
    EXPECT_FALSE(unhurried.cut_short);
    EXPECT_EQ(unhurried.deformation.displacement, free.deformation.displacement);
}

}  // namespace
}  // namespace tissuewarp::registration
