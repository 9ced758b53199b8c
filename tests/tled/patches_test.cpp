/// Patches and fans of a mesh, and GPU steps over them where they differ from two passes.
#include "core/errors.hpp"
#include "tests/tled/engine_scene.hpp"
#include "tled/gpu/patch_layout.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <set>

namespace tissuewarp::tled {
namespace {

using namespace scene;
using detail::cut_into_patches;
using detail::Fan;
using detail::Patch;
using Tet = std::array<int, 4>;

/// Tetrahedra of a fan in local numbers.
std::vector<Tet> tets_of(const Fan& fan) {
    std::vector<Tet> result;
    for (std::size_t i = 0; i < static_cast<std::size_t>(fan.length); ++i)
        result.push_back({fan.a, fan.b, fan.ring[i], fan.ring[i + 1]});
    return result;
}

Tet sorted(Tet tet) {
    std::sort(tet.begin(), tet.end());
    return tet;
}

RestState two_materials() {
    return rest_state(cube(6, Element::T4, Laws::Iso));
}

// A fan in the wrong sense, or a tetrahedron twice or not at all, would be a wrong force in every step.
TEST(Patches, FansHoldEveryTetrahedronOnceAndTurnTheRightWay) {
    const RestState rest = two_materials();
    for (const int longest : {1, 3, 5})
        for (const Patch& patch : cut_into_patches(rest, {150, longest})) {
            std::multiset<Tet> expected, seen;
            for (const int e : patch.tet)
                expected.insert(sorted({rest.nodes(0, e), rest.nodes(1, e), rest.nodes(2, e), rest.nodes(3, e)}));
            for (const Fan& fan : patch.fan) {
                ASSERT_LE(fan.length, longest);
                for (const Tet& local : tets_of(fan)) {
                    const auto X = [&](std::size_t k) {
                        return Vector3d(rest.position.col(patch.node[static_cast<std::size_t>(local[k])]));
                    };
                    EXPECT_GT((X(1) - X(0)).dot((X(2) - X(0)).cross(X(3) - X(0))), 0);
                    Tet global{};
                    for (std::size_t k = 0; k < 4; ++k) global[k] = patch.node[static_cast<std::size_t>(local[k])];
                    seen.insert(sorted(global));
                }
            }
            EXPECT_EQ(seen, expected);
        }
}

// Short fans would load and leave each node several times: correct, but slow.
TEST(Patches, FansAreLong) {
    const std::vector<Patch> patches = cut_into_patches(rest_state(cube(8, Element::T4, Laws::Iso)), {1000, 5});
    double nodes = 0, tets = 0;
    for (const Patch& patch : patches) {
        tets += static_cast<double>(patch.tet.size());
        for (const Fan& fan : patch.fan) nodes += fan.length + 3;
    }
    EXPECT_LT(nodes / tets, 2.0);
}

TEST(Patches, AreOfOneMaterialAndOfNearlyEqualSize) {
    const RestState rest = two_materials();
    const std::vector<int> material = material_of_elements(rest);
    std::set<int> seen;
    for (const Patch& patch : cut_into_patches(rest, {100, 5})) {
        EXPECT_LE(patch.tet.size(), 100U);
        EXPECT_GE(patch.tet.size(), 50U);
        for (const int e : patch.tet) {
            EXPECT_EQ(material[static_cast<std::size_t>(e)], patch.material);
            EXPECT_TRUE(seen.insert(e).second) << "element " << e << " is in two patches";
        }
    }
    EXPECT_EQ(static_cast<int>(seen.size()), rest.element_count());
}

TEST(Patches, RefusesShapesThatAreNone) {
    const RestState rest = two_materials();
    EXPECT_THROW(cut_into_patches(rest, {0, 5}), InvalidInput);
    EXPECT_THROW(cut_into_patches(rest, {100, 0}), InvalidInput);
    EXPECT_THROW(cut_into_patches(rest, {100, 6}), InvalidInput);
}

// Tiny patches meet in too many at a node for the table of sources.
TEST(Patches, RefusesMoreSharersThanTheTableHolds) {
    const RestState rest = two_materials();
    const std::vector<Patch> tiny = cut_into_patches(rest, {1, 5});
    EXPECT_GT(detail::most_sharing(rest.node_count, tiny), detail::most_sharing_patches);
    EXPECT_THROW(detail::patch_layout(rest, tiny), InvalidInput);
}

class GpuSteps : public ::testing::TestWithParam<Element> {
protected:
    Model model = cube(5, GetParam(), Laws::LnJ);
    RestState rest = rest_state(model);
    const Matrix3Xd& X = model.mesh.nodes;
    Matrix3Xd zero = Matrix3Xd::Zero(3, rest.node_count);
    NodalConditions conditions = nodal_conditions(mixed_conditions(model.mesh), rest.node_count);

    Matrix3Xd after(const GpuStepShape& shape, const std::vector<int>& runs, const Matrix3Xd& start,
                    const Matrix3Xd& increment) {
        const auto engine = make_gpu_engine(rest, -1, shape);
        engine->set_conditions(conditions);
        engine->set_state(start, increment);
        for (const int steps : runs) engine->run(steps, stable_coefficients(model, rest));
        return engine->displacement();
    }
};

INSTANTIATE_TEST_SUITE_P(All, GpuSteps, ::testing::Values(Element::T4, Element::AveragedPressureT4),
                         [](const auto& each) { return std::string(name_of(each.param)); });

// Floating-point sums in the order in which invocations happen to run would differ from run to run.
TEST_P(GpuSteps, RepeatBitByBit) {
    const Matrix3Xd first = after(small_patches, {60}, wavy(X, 0.3), zero);
    EXPECT_TRUE(after(small_patches, {60}, wavy(X, 0.3), zero) == first);
    EXPECT_TRUE(after(small_patches, {25, 35}, wavy(X, 0.3), zero) == first) << "in two runs";
}

// One workgroup has all patches, so that it needs no neighbour that runs at the same time: one patch, which stays in
// shared memory, or several in turn, each of which takes the place of the one before.
TEST_P(GpuSteps, ManyInADispatchAreThoseOneByOne) {
    for (const int patch_tets : {100000, 150}) {
        if (patch_tets > 750) {  // of one material, or there are two patches
            Model alone = model;
            alone.mesh.labels.setOnes();
            rest = rest_state(alone);
        } else {
            rest = rest_state(model);
        }
        const GpuStepShape one{.patch_tets = patch_tets, .longest_fan = 5, .workgroup = 128};
        GpuStepShape many = one;
        many.at_once = 1;
        const Matrix3Xd start = wavy(X, 0.3);
        const std::string patches = " steps over patches of " + std::to_string(patch_tets);
        for (const int steps : {1, 2, 43})
            EXPECT_TRUE(after(many, {steps}, start, zero) == after(one, {steps}, start, zero)) << steps << patches;
        EXPECT_TRUE(after(many, {1, 30, 12}, start, zero) == after(one, {43}, start, zero)) << "1 + 30 + 12" << patches;
    }
}

// Nodes that no other patch holds go ahead of the rest within a run; at its end all must have taken as many steps.
TEST_P(GpuSteps, RunsOfAnyLengthAddUp) {
    const Matrix3Xd start = wavy(X, 0.3);
    EXPECT_TRUE(after(small_patches, {1, 1, 2, 3}, start, zero) == after(small_patches, {7}, start, zero));
}

// A rasteriser that runs workgroups one after the other must be found out: the state would stand still or be torn.
TEST_P(GpuSteps, GoOnOneByOneWherePatchesDoNotRunAtTheSameTime) {
    GpuStepShape shape = small_patches;
    const Matrix3Xd expected = after(shape, {40}, wavy(X, 0.3), zero);
    shape.at_once = 1000;
    EXPECT_LT(largest(after(shape, {40}, wavy(X, 0.3), zero) - expected), 1e-5 * largest(expected));
    const auto engine = make_gpu_engine(rest, -1, shape);
    engine->set_conditions(conditions);
    engine->set_state(wavy(X, 0.3), zero);
    const StepCoefficients coefficients = stable_coefficients(model, rest);
    const CheckedDisplacement checked =
        engine->run_and_check(std::array{Steps{15, coefficients}, Steps{25, coefficients}});
    EXPECT_LT(largest(checked.value - expected), 1e-5 * largest(expected));
    EXPECT_LT(largest(engine->displacement() - checked.value), 1e-12);
}

// The last bits of a result follow from the shape of the steps: whoever keeps the result must be able to keep that too.
TEST_P(GpuSteps, AreNamedWithTheEngine) {
    EXPECT_THAT(make_gpu_engine(rest, -1, {150, 5, 128, 1})->description(),
                ::testing::EndsWith(", patches 150:5:128:1"));
    EXPECT_THAT(make_gpu_engine(rest, -1, {150, 5, 128, 0})->description(), ::testing::EndsWith(", patches 150:5:128"));
}

// Integers that overflow would turn a push into a pull.
TEST_P(GpuSteps, ForcesThatGrowAThousandfoldInAStepStillFit) {
    conditions = nodal_conditions({}, rest.node_count);
    const Matrix3Xd start = wavy(X, 1e-4), increment = wavy(X, 0.3);
    const StepCoefficients coefficients = stable_coefficients(model, rest);
    const PlainState plain = plain_steps(rest, conditions, lumped(rest), start, increment, 3, coefficients);
    EXPECT_LT(largest(after(small_patches, {3}, start, increment) - plain.u), 5e-6 * largest(plain.u));
}

// Sums of integers know no NaN: an inverted element must not pass as a force of some size.
TEST_P(GpuSteps, AnInvertedElementLeavesNoFiniteForce) {
    conditions = nodal_conditions({}, rest.node_count);
    Matrix3Xd start = zero;
    start.row(2) = -1.5 * X.row(2);
    EXPECT_FALSE(after(small_patches, {2}, start, zero).allFinite());
}

// In single precision an edge between nodes a metre from the origin would have lost a thousandth.
TEST_P(GpuSteps, AnOrganFarFromTheOriginMovesTheSame) {
    const Matrix3Xd near = after(small_patches, {60}, wavy(X, 0.3), zero);
    const Matrix3Xd start = wavy(X, 0.3);
    Model far_model = model;
    far_model.mesh.nodes.colwise() += Vector3d(1000, -700, 400);
    rest = rest_state(far_model);
    EXPECT_LT(largest(after(small_patches, {60}, start, zero) - near), 1e-5 * largest(near));
}

// A patch has one material, and a node room for 16 patches. A failure looks like: patches that grow until their size
// overflows.
TEST(GpuStepsOfManyMaterials, AreThoseOfTwoPassesWhereMoreMeetThanANodeHasRoomFor) {
    Model model = cube(3, Element::T4, Laws::Iso);
    model.materials.clear();
    for (int t = 0; t < model.mesh.tet_count(); ++t) {
        const int label = 1 + t % 29;
        model.mesh.labels[t] = label;
        model.materials[label] = NeoHookeanIso{1.0 + 0.1 * label, 50.0};
    }
    const RestState rest = rest_state(model);
    const auto engine = make_gpu_engine(rest, -1, small_patches);
    const NodalConditions conditions = nodal_conditions(mixed_conditions(model.mesh), rest.node_count);
    const StepCoefficients coefficients = stable_coefficients(model, rest);
    engine->set_conditions(conditions);
    engine->run(20, coefficients);
    const Matrix3Xd zero = Matrix3Xd::Zero(3, rest.node_count);
    const PlainState plain = plain_steps(rest, conditions, lumped(rest), zero, zero, 20, coefficients);
    EXPECT_LT(largest(engine->displacement() - plain.u), 5e-6 * largest(plain.u));
}

}  // namespace
}  // namespace tissuewarp::tled
