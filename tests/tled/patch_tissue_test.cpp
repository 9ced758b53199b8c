/// Fibres and viscosity over patches on the GPU, against the plain loop and the other shapes of steps.
#include "tests/tled/engine_scene.hpp"
#include "tled/gpu/patch_layout.hpp"

#include <gmock/gmock.h>

#include <set>
#include <string>
#include <tuple>

namespace tissuewarp::tled {
namespace {

using namespace scene;

/// Fibres: both materials have them, each element in a direction of its own. Viscosity: one and three terms. Partly:
/// of two materials of one law the second is elastic.
enum class Tissue { Fibres, Viscosity, Both, Partly };

const char* name_of(Tissue tissue) {
    constexpr const char* names[] = {"Fibres", "Viscosity", "Both", "Partly"};
    return names[static_cast<int>(tissue)];
}

Model model_of(int edge_cells, Element element, Tissue tissue) {
    const bool fibres = tissue == Tissue::Fibres || tissue == Tissue::Both;
    Model model = cube(edge_cells, element, fibres ? Laws::TwoFibres : Laws::LnJ);
    if (tissue != Tissue::Fibres) model.viscosity[1] = {{{0.2, 0.002}, {0.1, 0.02}, {0.3, 0.2}}};
    if (tissue == Tissue::Viscosity || tissue == Tissue::Both) model.viscosity[2] = {{{0.3, 0.01}}};
    if (fibres) {
        model.fibre.resize(3, model.mesh.tet_count());
        for (int t = 0; t < model.mesh.tet_count(); ++t)
            model.fibre.col(t) = Vector3d(std::sin(1.0 + t), std::cos(2.3 * t), std::sin(0.7 * t)).normalized();
    }
    return model;
}

/// Of what stresses that rest do to displacements: they are rounded by 2⁻¹² at most.
constexpr double half_precision = 2e-5;

class PatchTissue : public ::testing::TestWithParam<std::tuple<Element, Tissue>> {
protected:
    Model model = model_of(5, std::get<0>(GetParam()), std::get<1>(GetParam()));
    RestState rest = rest_state(model);
    const Matrix3Xd& X = model.mesh.nodes;
    Matrix3Xd zero = Matrix3Xd::Zero(3, rest.node_count);
    NodalConditions conditions = nodal_conditions(mixed_conditions(model.mesh), rest.node_count);
    Matrix3Xd start = wavy(X, 0.3);

    [[nodiscard]] StepCoefficients coefficients(double time_step = 0.0005) const {
        StepCoefficients step = stable_coefficients(model, rest);
        step.time_step = time_step;
        return step;
    }

    std::unique_ptr<Engine> engine(const GpuStepShape& shape) {
        auto made = make_gpu_engine(rest, -1, shape);
        made->set_conditions(conditions);
        made->set_state(start, zero);
        return made;
    }

    Matrix3Xd after(const GpuStepShape& shape, const std::vector<int>& runs) {
        const auto made = engine(shape);
        for (const int steps : runs) made->run(steps, coefficients());
        return made->displacement();
    }
};

INSTANTIATE_TEST_SUITE_P(
    All, PatchTissue,
    ::testing::Values(std::tuple{Element::T4, Tissue::Fibres}, std::tuple{Element::T4, Tissue::Partly},
                      std::tuple{Element::T4, Tissue::Both}, std::tuple{Element::AveragedPressureT4, Tissue::Viscosity},
                      std::tuple{Element::AveragedPressureT4, Tissue::Both}),
    [](const auto& each) {
        return std::string(scene::name_of(std::get<0>(each.param))) + name_of(std::get<1>(each.param));
    });

// Everything below would pass, slowly, over two passes.
TEST_P(PatchTissue, RunsOverPatches) {
    EXPECT_THAT(engine(small_patches)->description(), ::testing::HasSubstr(", patches "));
}

// A failure looks like: a stress that advances twice in a step, or while somebody looks; fibres of another element.
TEST_P(PatchTissue, StepsFollowThePlainLoop) {
    const auto made = engine(small_patches);
    PlainStresses stresses(rest);
    PlainStresses* viscous = rest.viscosity.empty() ? nullptr : &stresses;
    made->run(60, coefficients());
    made->residual();
    made->run(1, coefficients());
    made->observe();
    made->run(39, coefficients());
    const PlainState plain = plain_steps(rest, conditions, lumped(rest), start, zero, 100, coefficients(), viscous);
    EXPECT_LT(largest(made->displacement() - plain.u), 5e-6 * largest(plain.u));
    EXPECT_LT(largest(made->increment() - plain.v), 1e-4 * largest(plain.v));
    const Matrix3Xd expected = viscous ? stresses.force(rest, plain.u) : internal_force(rest, plain.u);
    EXPECT_LT(largest(made->internal_force() - expected), 2e-5 * largest(expected));
}

// Sixteen steps and more for each of the stresses: the shortest relaxation time is 0.002 s, or longer.
TEST_P(PatchTissue, StepsInWhichStressesRestFollowThePlainLoop) {
    const double time_step = 0.002 / (32 * 17);
    const auto made = engine(small_patches);
    PlainStresses stresses(rest);
    PlainStresses* viscous = rest.viscosity.empty() ? nullptr : &stresses;
    for (const int steps : {1, 40, 59}) made->run(steps, coefficients(time_step));
    const PlainState plain =
        plain_steps(rest, conditions, lumped(rest), start, zero, 100, coefficients(time_step), viscous);
    const double tolerance = viscous ? half_precision : 5e-6;
    EXPECT_LT(largest(made->displacement() - plain.u), tolerance * largest(plain.u));
    const Matrix3Xd expected = viscous ? stresses.force(rest, plain.u) : internal_force(rest, plain.u);
    EXPECT_LT(largest(made->internal_force() - expected), 4 * tolerance * largest(expected));
}

// One workgroup takes several patches in turn.
TEST_P(PatchTissue, ManyStepsInWhichStressesRestAreThoseOneByOne) {
    const auto after_rests = [&](int at_once, const std::vector<int>& runs) {
        const auto made = engine({.patch_tets = 150, .longest_fan = 5, .workgroup = 128, .at_once = at_once});
        for (const int steps : runs) made->run(steps, coefficients(0.002 / (32 * 17)));
        return made->displacement();
    };
    const Matrix3Xd expected = after_rests(0, {43});
    EXPECT_TRUE(after_rests(1, {43}) == expected);
    EXPECT_TRUE(after_rests(1, {1, 30, 12}) == expected);
}

// The forces that a run ends with are of its own time step, those that the next one needs of another; 0 holds stresses.
TEST_P(PatchTissue, TheTimeStepMayChangeBetweenRuns) {
    const auto made = engine(small_patches);
    PlainStresses stresses(rest);
    PlainStresses* viscous = rest.viscosity.empty() ? nullptr : &stresses;
    PlainState plain{start, zero, zero};
    for (const double time_step : {0.0005, 0.005, 0.0, 0.0001}) {
        made->run(15, coefficients(time_step));
        plain = plain_steps(rest, conditions, lumped(rest), plain.u, plain.v, 15, coefficients(time_step), viscous);
    }
    EXPECT_LT(largest(made->displacement() - plain.u), (viscous ? half_precision : 5e-6) * largest(plain.u));
}

TEST_P(PatchTissue, RepeatsBitByBitInRunsOfAnyLength) {
    const Matrix3Xd first = after(small_patches, {60});
    EXPECT_TRUE(after(small_patches, {60}) == first);
    EXPECT_TRUE(after(small_patches, {1, 2, 25, 32}) == first) << "in four runs";
}

// One workgroup takes several patches in turn.
TEST_P(PatchTissue, ManyStepsInADispatchAreThoseOneByOne) {
    const GpuStepShape one{.patch_tets = 150, .longest_fan = 5, .workgroup = 128};
    GpuStepShape many = one;
    many.at_once = 1;
    const Matrix3Xd expected = after(one, {43});
    EXPECT_TRUE(after(many, {43}) == expected);
    EXPECT_TRUE(after(many, {1, 30, 12}) == expected);
}

// One patch that a workgroup keeps: 162 tetrahedra, whose viscous stresses of 72 B each stay in shared memory, and 750,
// whose stresses do not fit into the 32 to 48 kB that devices have.
TEST_P(PatchTissue, ManyStepsOfOnePatchAreThoseOneByOne) {
    for (const int edge_cells : {3, 5}) {
        model = model_of(edge_cells, std::get<0>(GetParam()), std::get<1>(GetParam()));
        model.mesh.labels.setOnes();
        rest = rest_state(model);
        zero = Matrix3Xd::Zero(3, rest.node_count);
        conditions = nodal_conditions(mixed_conditions(model.mesh), rest.node_count);
        start = wavy(X, 0.3);
        const GpuStepShape one{.patch_tets = 100000, .longest_fan = 3, .workgroup = 64};
        GpuStepShape many = one;
        many.at_once = 1;
        const Matrix3Xd expected = after(one, {43});  // long steps: stresses move with each, in both shapes
        EXPECT_TRUE(after(many, {43}) == expected) << edge_cells;
        EXPECT_TRUE(after(many, {1, 30, 12}) == expected) << edge_cells;
    }
}

TEST_P(PatchTissue, GoOnOneByOneWherePatchesDoNotRunAtTheSameTime) {
    GpuStepShape shape = small_patches;
    const Matrix3Xd expected = after(shape, {40});
    shape.at_once = 1000;
    EXPECT_LT(largest(after(shape, {40}) - expected), 1e-5 * largest(expected));
}

// To the last bits but not beyond: the units of sums follow from the forces of the step before, which are forgotten. A
// failure looks like: stresses of the state that was left.
TEST_P(PatchTissue, ReturnsToTheKeptState) {
    const auto made = engine(small_patches);
    made->run(20, coefficients());
    made->keep_state();
    made->run(30, coefficients());
    const Matrix3Xd u = made->displacement();
    const auto returned = [&] {
        made->set_state(wavy(X), wavy(X, 0.01));  // forgets viscous stresses
        made->run(3, coefficients());
        made->return_to_kept_state();
        made->run(30, coefficients());
        return made->displacement();
    };
    const Matrix3Xd once = returned();
    EXPECT_LT(largest(once - u), 1e-6 * largest(u));
    EXPECT_TRUE(returned() == once);
}

TEST_P(PatchTissue, ANewStateForgetsWhatTheTissueWentThrough) {
    const auto made = engine(small_patches);
    made->run(20, coefficients());
    made->set_state(start, zero);
    made->run(20, coefficients());
    EXPECT_TRUE(made->displacement() == after(small_patches, {20}));
}

// A patch whose forces outgrow their unit computes them again: a stress that advanced then too would be a step ahead,
// which one long time step shows.
TEST_P(PatchTissue, ForcesThatGrowAThousandfoldInAStepAdvanceStressesOnce) {
    conditions = nodal_conditions({}, rest.node_count);
    const Matrix3Xd increment = wavy(X, 0.3);
    start = wavy(X, 1e-4);
    const auto made = engine(small_patches);
    made->set_increment(increment);
    made->run(4, coefficients(0.01));
    PlainStresses stresses(rest);
    PlainStresses* viscous = rest.viscosity.empty() ? nullptr : &stresses;
    const PlainState plain =
        plain_steps(rest, conditions, lumped(rest), start, increment, 4, coefficients(0.01), viscous);
    EXPECT_LT(largest(made->displacement() - plain.u), 5e-6 * largest(plain.u));
    if (!viscous) return;
    const Matrix3Xd expected = stresses.force(rest, plain.u);
    EXPECT_LT(largest(made->internal_force() - expected), 2e-5 * largest(expected));
}

// An element at two places, or at none, would relax twice or never.
TEST_P(PatchTissue, EveryElementHasOnePlace) {
    const std::vector<detail::Patch> patches = detail::cut_into_patches(rest, {100, 3});
    const detail::PatchLayout layout = detail::patch_layout(rest, patches);
    const auto count = static_cast<std::size_t>(layout.capacity.patches),
               room = static_cast<std::size_t>(layout.capacity.fans);
    std::set<std::uint32_t> seen;
    ASSERT_EQ(layout.element_of_place.size(), count * room * 3);
    for (std::size_t place = 0; place < layout.element_of_place.size(); ++place) {
        const std::uint32_t e = layout.element_of_place[place];
        if (e == 0xffffffffU) continue;
        EXPECT_TRUE(seen.insert(e).second) << e;
        const std::size_t f = place % room, p = place / room % count, k = place / (room * count);
        const detail::Fan& fan = patches[p].fan[f];
        std::set<int> expected, nodes;
        for (const int local : {fan.a, fan.b, fan.ring[k], fan.ring[k + 1]})
            expected.insert(patches[p].node[static_cast<std::size_t>(local)]);
        for (int c = 0; c < 4; ++c) nodes.insert(rest.nodes(c, static_cast<Eigen::Index>(e)));
        EXPECT_EQ(nodes, expected) << e;
    }
    EXPECT_EQ(static_cast<int>(seen.size()), rest.element_count());
}

TEST(PlainTissue, HasNoPlaces) {
    const RestState rest = rest_state(cube(3, Element::T4, Laws::LnJ));
    EXPECT_TRUE(detail::patch_layout(rest, detail::cut_into_patches(rest, {100, 3})).element_of_place.empty());
}

}  // namespace
}  // namespace tissuewarp::tled
