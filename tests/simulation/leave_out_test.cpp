/// Scenes without the tissue that probes can do without, against the same scenes whole.

#include "simulation/run.hpp"

#include "core/errors.hpp"

#include <gmock/gmock.h>

#include <vector>

namespace tissuewarp::simulation {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

/// A bar of 160 mm along x, held on its lower side, heavier from moment to moment, pressed by 2 mm at one end, where
/// two probes are.
Scene bar() {
    Scene scene;
    scene.title = "bar";
    scene.geometry = BoxGeometry{Vector3d::Zero(), {160, 30, 30}, {32, 6, 6}};
    scene.tissues[1].material = tled::neo_hookean_iso(3, 0.4);
    scene.sets["base"].side = Side{2, false, 0.0};
    scene.sets["patch"].box = Box{{-1, -1, 29.9}, {15, 31, 30.1}};
    scene.fixed.push_back({"base"});
    scene.motions.push_back({"patch", {false, false, true}, {0, 0, -2}});
    scene.gravity = Gravity{{}, {0, 0, -1}};
    scene.probes = {{"under the patch", {6, 14, 16}}, {"beside it", {23, 11, 21}}};
    scene.solve.device = Device::Cpu;
    scene.solve.tolerance_mm = 1e-3;
    scene.solve.frames = 3;
    return scene;
}

std::vector<Matrix3Xd> probes_of(const BuiltScene& built) {
    std::vector<Matrix3Xd> frames;
    simulate(built, [&](const Frame& frame) { frames.push_back(probe_displacements(built, frame)); });
    return frames;
}

double largest_change(const std::vector<Matrix3Xd>& a, const std::vector<Matrix3Xd>& b) {
    double largest = 0;
    EXPECT_EQ(a.size(), b.size());
    for (std::size_t frame = 0; frame < std::min(a.size(), b.size()); ++frame)
        largest = std::max(largest, (a[frame] - b[frame]).colwise().norm().maxCoeff());
    return largest;
}

// A failure looks like: probes of a heavy bar that hang lower, since the rest of it does not carry its part, or that
// follow the press less than they should.
TEST(LeaveOut, ChangesNoProbeByMoreThanWasAskedFor) {
    const Scene whole = bar();
    const std::vector<Matrix3Xd> expected = probes_of(build(whole));
    int before = 0;
    for (const double tolerance : {0.06, 0.6}) {
        Scene scene = whole;
        scene.leave_out = LeaveOut{tolerance};
        const BuiltScene built = build(scene);
        ASSERT_TRUE(built.left_out) << tolerance;
        EXPECT_GE(built.left_out->tetrahedra, before);
        EXPECT_GE(4 * built.left_out->tetrahedra, built.mesh.tet_count());
        EXPECT_EQ(built.stages.front().rest.element_count(), built.mesh.tet_count() - built.left_out->tetrahedra);
        EXPECT_LE(built.left_out->estimated_change_mm, tolerance / 3);
        const double change = largest_change(probes_of(built), expected);
        EXPECT_LE(change, tolerance);
        EXPECT_NEAR(built.left_out->estimated_change_mm, change, 0.5 * change + 5e-3);
        before = built.left_out->tetrahedra;
    }
}

TEST(LeaveOut, HoldsInDynamics) {
    Scene scene = bar();
    scene.solve.kind = Solve::Kind::Dynamics;
    scene.solve.duration = 2;
    scene.solve.damping = 20;
    scene.geometry = BoxGeometry{Vector3d::Zero(), {160, 30, 30}, {16, 3, 3}};
    const std::vector<Matrix3Xd> expected = probes_of(build(scene));
    scene.leave_out = LeaveOut{0.3};
    const BuiltScene built = build(scene);
    ASSERT_TRUE(built.left_out);
    EXPECT_LE(largest_change(probes_of(built), expected), 0.3);
}

TEST(LeaveOut, KeepsWhatPressureActsOn) {
    Scene scene = bar();
    scene.sets["far end"].side = Side{0, true, 0.0};
    scene.pressures.push_back({"far end", 0.3});
    scene.leave_out = LeaveOut{0.6};
    const BuiltScene built = build(scene);
    ASSERT_TRUE(built.left_out);
    for (const int node : built.effects.pressures.front().faces.reshaped())
        EXPECT_GE(built.stages.front().place[static_cast<std::size_t>(node)], 0);
    Scene whole = scene;
    whole.leave_out.reset();
    EXPECT_LE(largest_change(probes_of(built), probes_of(build(whole))), 0.6);
}

// What touches is the load here: without it nothing would seem to be needed.
TEST(LeaveOut, KnowsOfAToolThatMovesIntoTheTissue) {
    Scene scene = bar();
    scene.motions.clear();
    scene.gravity.reset();
    scene.sets["top"].side = Side{2, true, 0.0};
    scene.contacts.push_back({"top", Ball{{10, 15, 40.5}, 10}});
    scene.contacts.back().motion.displacement = {3, 0, -4};
    const std::vector<Matrix3Xd> expected = probes_of(build(scene));
    EXPECT_GT(expected.back().colwise().norm().minCoeff(), 0.3);
    scene.leave_out = LeaveOut{0.3};
    const BuiltScene built = build(scene);
    ASSERT_TRUE(built.left_out);
    const double change = largest_change(probes_of(built), expected);
    EXPECT_LE(change, 0.012);  // 0.0103 of the 0.3 that is allowed
    EXPECT_NEAR(built.left_out->estimated_change_mm, change, 0.1 * change);
    scene.contacts.back().motion = {};  // no load at all
    EXPECT_FALSE(build(scene).left_out);
}

// Springs at nodes carry no moment: of a cantilever that is held at its far end nothing can be spared.
TEST(LeaveOut, SparesNothingThatProbesNeed) {
    Scene scene = bar();
    scene.sets["base"].side = Side{0, true, 0.0};
    scene.leave_out = LeaveOut{0.05};
    struct Listener : Observer {
        void note(std::string_view message) override { notes.emplace_back(message); }
        std::vector<std::string> notes;
    } listener;
    const BuiltScene built = build(scene, listener);
    EXPECT_FALSE(built.left_out);
    EXPECT_EQ(built.stages.front().rest.element_count(), built.mesh.tet_count());
    EXPECT_THAT(listener.notes, ::testing::Contains(::testing::HasSubstr("the probes need it all")));
}

}  // namespace
}  // namespace tissuewarp::simulation
