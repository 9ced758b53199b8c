/// The scalar step of the literature against the CPU engine in float64.
#include "tled/reference/scalar_steps.hpp"
#include "core/errors.hpp"
#include "tests/tled/engine_scene.hpp"

#include <gmock/gmock.h>

namespace tissuewarp::tled {
namespace {

using namespace scene;

/// A cube of two materials with both ends imposed, a free component on top.
struct Scene {
    explicit Scene(Laws laws, Element element = Element::T4)
        : model(cube(5, element, laws)),
          rest(rest_state(model)),
          conditions(nodal_conditions(imposed_ends(), rest.node_count)),
          coefficients(stable_coefficients(model, rest)),
          start(wavy(model.mesh.nodes, 0.3)),
          still(Matrix3Xd::Zero(3, rest.node_count)) {}

    [[nodiscard]] Conditions imposed_ends() const {
        Conditions imposed;
        for (int node = 0; node < model.mesh.node_count(); ++node) {
            const double z = model.mesh.nodes(2, node);
            if (z < 1e-9) imposed.prescribed.push_back({node, {true, true, true}, {0, 0, 0}});
            if (z > 30 - 1e-9) imposed.prescribed.push_back({node, {true, false, true}, {0.6, 0, -1.5}});
        }
        return imposed;
    }
    [[nodiscard]] ScalarSteps steps() const { return {rest, conditions, lumped(rest)}; }

    Model model;
    RestState rest;
    NodalConditions conditions;
    StepCoefficients coefficients;
    Matrix3Xd start, still;
};

void expect_follows(const Scene& scene, int steps) {
    const auto exact = make_cpu_engine(scene.rest, Scalar::Float64);
    exact->set_conditions(scene.conditions);
    exact->set_state(scene.start, scene.still);
    const Matrix3Xd begin = exact->displacement();
    exact->run(steps, scene.coefficients);
    ScalarSteps scalar = scene.steps();
    scalar.set_state(scene.start, scene.still);
    scalar.run(steps, scene.coefficients);
    const Matrix3Xd u = exact->displacement(), v = exact->increment();
    EXPECT_GT(largest(u - begin), steps > 1 ? 0.1 : 1e-4) << "the test does not move";
    EXPECT_LT(largest(scalar.displacement() - u), 5e-6 * largest(u));
    EXPECT_LT(largest(scalar.increment() - v), 1e-3 * largest(v));
}

class ScalarLaws : public ::testing::TestWithParam<Laws> {};

INSTANTIATE_TEST_SUITE_P(All, ScalarLaws, ::testing::Values(Laws::Iso, Laws::LnJ, Laws::Mixed),
                         [](const auto& each) { return name_of(each.param); });

// A wrong stress, a force on the wrong corner or a sign fails at the first step.
TEST_P(ScalarLaws, OneStepIsTheCpuEngines) {
    expect_follows(Scene(GetParam()), 1);
}

// Forces that are not cleared between steps, momentum, drift in float32.
TEST_P(ScalarLaws, TwoHundredStepsFollowTheCpuEngine) {
    expect_follows(Scene(GetParam()), 200);
}

// A release in another order of sums, or memory that is not initialised, gives other bits.
TEST(ScalarSteps, RepeatBitByBitInPortionsToo) {
    const Scene scene(Laws::LnJ);
    ScalarSteps once = scene.steps(), portions = scene.steps();
    once.set_state(scene.start, scene.still);
    once.run(30, scene.coefficients);
    portions.set_state(scene.start, scene.still);
    for (const int steps : {1, 12, 0, 17}) portions.run(steps, scene.coefficients);
    EXPECT_EQ(once.displacement(), portions.displacement());
    EXPECT_EQ(once.increment(), portions.increment());
}

// A free component that is held, or an imposed one that moves, shows.
TEST(ScalarSteps, ImposedDisplacementsStay) {
    const Scene scene(Laws::Iso);
    ScalarSteps scalar = scene.steps();
    scalar.set_state(scene.start, wavy(scene.model.mesh.nodes, 0.01));
    scalar.run(20, scene.coefficients);
    const Matrix3Xd u = scalar.displacement();
    for (Eigen::Index node = 0; node < u.cols(); ++node)
        for (Eigen::Index i = 0; i < 3; ++i) {
            if (scene.conditions.constrained(i, node))
                EXPECT_EQ(u(i, node), double(float(scene.conditions.imposed(i, node))));
            else
                EXPECT_NE(u(i, node), double(float(scene.start(i, node))));
        }
}

TEST(ScalarSteps, RefuseWhatTheyDoNotKnow) {
    const auto refused = [](const Scene& scene) { return scene.steps(); };
    EXPECT_THROW(refused(Scene(Laws::Ogden)), InvalidInput);
    EXPECT_THROW(refused(Scene(Laws::LnJ, Element::AveragedPressureT4)), InvalidInput);
    Scene loaded(Laws::LnJ);
    loaded.conditions.external_force(0, 3) = 1;
    EXPECT_THROW(refused(loaded), InvalidInput);
    const Scene scene(Laws::LnJ);
    EXPECT_THROW(ScalarSteps(scene.rest, scene.conditions, -lumped(scene.rest)), InvalidInput);
    ScalarSteps scalar = scene.steps();
    EXPECT_THROW(scalar.set_state(Matrix3Xd::Zero(3, 2), scene.still), InvalidInput);
}

}  // namespace
}  // namespace tissuewarp::tled
