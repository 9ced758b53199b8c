/// The counted model of a step's cost.
#include "tled/step_work.hpp"
#include "meshing/primitives.hpp"

#include <gmock/gmock.h>

namespace tissuewarp::tled {
namespace {

RestState cube(int cells) {
    Model model;
    model.mesh = meshing::box_mesh({100, 100, 100}, {cells, cells, cells});
    model.materials = {{1, NeoHookeanLnJ{1.007, 49.329}}};
    model.element = Element::T4;
    return rest_state(model);
}

// By hand: 216 nodes and 750 tetrahedra.
TEST(StepWork, OfTwoPassesIsThatOfTheirArrays) {
    const StepWork work = gpu_step_work(cube(5), {});
    EXPECT_NEAR(work.bytes, 208 + 104 * 216.0 / 750, 1e-9);
    EXPECT_NEAR(work.flops, 241 + 12 * 216.0 / 750, 1e-9);
}

// By hand: 8 nodes and 6 tetrahedra, fans of one each in a group of 16 lanes with 4 nodes.
TEST(StepWork, OfTheCpuIsThatOfItsFans) {
    const StepWork work = cpu_step_work(cube(1));
    EXPECT_NEAR(work.bytes, (16 * 44 + 64 * 2 + 24 * 2 + 8 * 24 + 8 * 128) / 6.0, 1e-9);
    EXPECT_NEAR(work.flops, 266 + 15 + 4 * 3 + 8 * 18 / 6.0, 1e-9);
}

// What fans are for: most tetrahedra share nodes with the next. Below, a plain list of tetrahedra with a force of 16 B
// for each corner, written and read.
TEST(StepWork, OfTheCpuMovesLessThanCornerForcesDo) {
    const RestState rest = cube(20);
    EXPECT_LT(cpu_step_work(rest).bytes, 60 + 64 + 64 + 16);
    EXPECT_GT(cpu_step_work(rest).bytes, 44 + 128.0 * rest.node_count / rest.element_count());
}

// One patch shares no node: 216 slots, no force leaves it but to itself. Fans of one tetrahedron each.
TEST(StepWork, OfOnePatchIsThatOfItsSlotsAndFans) {
    const RestState rest = cube(5);
    const StepWork work = gpu_step_work(rest, {.patch_tets = 750, .longest_fan = 1});
    EXPECT_NEAR(work.bytes, (216 * (28 + 36) + 750 * 16) / 750.0, 1e-9);
    const StepWork persisting = gpu_step_work(rest, {.patch_tets = 750, .longest_fan = 1, .at_once = 1});
    EXPECT_NEAR(persisting.bytes, (216 * 28 + 750 * 16) / 750.0, 1e-9);
}

// Shared nodes cost: a model that forgets them would give small patches for free.
TEST(StepWork, OfPatchesGrowsAsTheyShrink) {
    const RestState rest = cube(10);
    double before = 0;
    for (const int tets : {6000, 1000, 200}) {
        const StepWork work = gpu_step_work(rest, {.patch_tets = tets, .longest_fan = 5});
        EXPECT_GT(work.bytes, before);
        before = work.bytes;
    }
    EXPECT_LT(before, gpu_step_work(rest, {}).bytes) << "patches exist to move less than two passes";
}

}  // namespace
}  // namespace tissuewarp::tled
