/// The render passes of 2007 against the CPU engine in float64.
#include "core/errors.hpp"
#include "tests/tled/engine_scene.hpp"
#include "tled/render_pass/render_pass_engine.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace tissuewarp::tled {
namespace {

using namespace scene;

/// The bottom held, a zero included among what is imposed on the top.
Conditions imposed_ends(const meshing::TetMesh& mesh) {
    Conditions conditions;
    for (int node = 0; node < mesh.node_count(); ++node) {
        const double z = mesh.nodes(2, node);
        if (z < 1e-9) conditions.prescribed.push_back({node, {true, true, true}, {0, 0, 0}});
        if (z > 30 - 1e-9) conditions.prescribed.push_back({node, {true, false, true}, {0.6, 0, -1.5}});
    }
    return conditions;
}

struct Scene {
    explicit Scene(Model the_model)
        : model(std::move(the_model)),
          rest(rest_state(model)),
          conditions(nodal_conditions(imposed_ends(model.mesh), rest.node_count)),
          coefficients(stable_coefficients(model, rest)),
          start(wavy(model.mesh.nodes, 0.3)),
          still(Matrix3Xd::Zero(3, rest.node_count)) {}
    Model model;
    RestState rest;
    NodalConditions conditions;
    StepCoefficients coefficients;
    Matrix3Xd start, still;
};

/// The tetrahedra around `hub` cut into four at their centres: the hub gets three times as many, the new nodes four.
void add_hub(meshing::TetMesh& mesh, int hub) {
    for (int t = 0, count = mesh.tet_count(); t < count; ++t) {
        const Eigen::Vector4i corners = mesh.tets.col(t);
        if ((corners.array() != hub).all()) continue;
        const int centre = mesh.node_count(), added = mesh.tet_count();
        mesh.nodes.conservativeResize(3, centre + 1);
        mesh.nodes.col(centre) = mesh.nodes(Eigen::all, corners).rowwise().mean();
        mesh.tets.conservativeResize(4, added + 3);
        for (int k = 0; k < 4; ++k) {
            Eigen::Vector4i part = corners;
            part[k] = centre;
            mesh.tets.col(k == 0 ? t : added + k - 1) = part;
        }
    }
    mesh.labels.setOnes(mesh.tet_count());
}

/// What is left of a jittered box inside a ball, with a hub, its nodes renumbered at random: no grid's valences, no
/// order in which a wrong look-up would be right by chance.
Model irregular_ball() {
    meshing::TetMesh box = meshing::box_mesh({30, 30, 30}, {7, 7, 7}, 0.15, 11);
    add_hub(box, 3 + 8 * (3 + 8 * 3));
    std::vector<int> tets;
    std::set<int> nodes;
    for (int t = 0; t < box.tet_count(); ++t) {
        const Vector3d centre = box.nodes(Eigen::all, box.tets.col(t)).rowwise().mean();
        if ((centre - Vector3d(15, 15, 14)).norm() > 14.5) continue;
        tets.push_back(t);
        nodes.insert(box.tets.col(t).begin(), box.tets.col(t).end());
    }
    std::vector<int> order(nodes.begin(), nodes.end());
    std::shuffle(order.begin(), order.end(), std::mt19937(5));
    std::map<int, int> number;  // of the box's nodes
    for (const int node : order) number.emplace(node, static_cast<int>(number.size()));
    Model model;
    model.mesh.nodes = box.nodes(Eigen::all, order);
    model.mesh.tets = box.tets(Eigen::all, tets).unaryExpr([&](int node) { return number.at(node); });
    model.mesh.labels = box.labels(tets);
    model.materials = {{1, NeoHookeanLnJ{1.007, 49.329}}};
    model.element = Element::T4;
    return model;
}

/// Holds the lowest and moves the highest nodes of a mesh without flat faces.
void hold_poles(Scene& scene) {
    Conditions conditions;
    const Matrix3Xd& X = scene.model.mesh.nodes;
    const double low = X.row(2).minCoeff(), high = X.row(2).maxCoeff();
    for (int node = 0; node < scene.rest.node_count; ++node) {
        if (X(2, node) < low + 4) conditions.prescribed.push_back({node, {true, true, true}, {0, 0, 0}});
        if (X(2, node) > high - 4) conditions.prescribed.push_back({node, {true, false, true}, {0.4, 0, -1}});
    }
    scene.conditions = nodal_conditions(conditions, scene.rest.node_count);
}

/// Displacement and increment of the float64 CPU engine after `steps` from the scene's start.
std::pair<Matrix3Xd, Matrix3Xd> exact(const Scene& scene, int steps) {
    const auto cpu = make_cpu_engine(scene.rest, Scalar::Float64);
    cpu->set_conditions(scene.conditions);
    cpu->set_state(scene.start, scene.still);
    cpu->run(steps, scene.coefficients);
    return {cpu->displacement(), cpu->increment()};
}

void expect_follows(const Scene& scene, int steps) {
    RenderPassEngine engine(scene.rest, scene.conditions, lumped(scene.rest));
    engine.set_state(scene.start, scene.still);
    engine.run(steps, scene.coefficients);
    const auto [u, v] = exact(scene, steps);
    EXPECT_GT(largest(u - exact(scene, 0).first), steps > 1 ? 0.1 : 1e-4) << "the test does not move";
    EXPECT_LT(largest(engine.displacement() - u), 5e-6 * largest(u));
    EXPECT_LT(largest(engine.increment() - v), 1e-4 * largest(v));
}

class RenderPasses : public ::testing::TestWithParam<Laws> {};

INSTANTIATE_TEST_SUITE_P(All, RenderPasses, ::testing::Values(Laws::Iso, Laws::LnJ, Laws::Stable),
                         [](const auto& each) { return name_of(each.param); });

// A wrong law, a corner's force in another's texture or a material read of another texel fails at the first step.
TEST_P(RenderPasses, OneStepIsTheCpuEngines) {
    expect_follows(Scene(cube(5, Element::T4, GetParam())), 1);
}

// What one step hides: the pair of textures that is read, momentum, and drift in float32.
TEST_P(RenderPasses, TwoHundredStepsFollowTheCpuEngine) {
    const Scene scene(cube(5, Element::T4, GetParam()));
    expect_follows(scene, 200);
}

// More elements than the longest side of a texture on many devices (16384): the lists lie in rows.
TEST(RenderPassEngine, TakesMoreElementsThanATextureIsWide) {
    const Scene scene(cube(14, Element::T4, Laws::LnJ));
    ASSERT_GT(scene.rest.element_count(), 16384);
    expect_follows(scene, 1);
}

// A gather that assumes a grid's valences, or an order of nodes, fails here.
TEST(RenderPassEngine, FollowsTheCpuEngineOnAnIrregularMesh) {
    Scene scene(irregular_ball());
    hold_poles(scene);
    std::set<int> valences;
    for (std::size_t a = 0; a + 1 < scene.rest.incidence.offset.size(); ++a)
        valences.insert(scene.rest.incidence.offset[a + 1] - scene.rest.incidence.offset[a]);
    ASSERT_GT(valences.size(), 10u);
    ASSERT_EQ(*valences.begin(), 1);
    ASSERT_EQ(*valences.rbegin(), 72);
    expect_follows(scene, 1);
    expect_follows(scene, 200);
}

/// One engine on a small cube with two materials.
class RenderPassesInUse : public ::testing::Test {
protected:
    Scene scene{cube(4, Element::T4, Laws::LnJ)};
    RenderPassEngine engine = engine_of(scene.rest, scene.conditions);

    static RenderPassEngine engine_of(const RestState& rest, const NodalConditions& conditions) {
        return {rest, conditions, lumped(rest)};
    }

    /// The displacement after steps in these portions from the scene's start.
    Matrix3Xd run(RenderPassEngine& each, const std::vector<int>& portions) const {
        each.set_state(scene.start, scene.still);
        for (const int steps : portions) each.run(steps, scene.coefficients);
        return each.displacement();
    }
};

TEST_F(RenderPassesInUse, RepeatBitByBit) {
    const Matrix3Xd first = run(engine, {100});
    EXPECT_EQ(run(engine, {100}), first);
    RenderPassEngine other = engine_of(scene.rest, scene.conditions);
    EXPECT_EQ(run(other, {100}), first);
}

// Odd portions end in the other pair of textures: reading or writing the wrong one shows.
TEST_F(RenderPassesInUse, RunningInPortionsIsRunningAtOnce) {
    const Matrix3Xd at_once = run(engine, {30});
    EXPECT_EQ(run(engine, {1, 12, 0, 17}), at_once);
}

TEST_F(RenderPassesInUse, StayAtRestWithoutLoads) {
    RenderPassEngine free = engine_of(scene.rest, nodal_conditions({}, scene.rest.node_count));
    free.run(10, scene.coefficients);
    EXPECT_EQ(free.displacement(), scene.still);
}

// Nodes held at zero are held as much as those that are moved, whatever state is set, bit by bit.
TEST_F(RenderPassesInUse, ImposedDisplacementsStayAZeroIncluded) {
    engine.set_state(scene.start, wavy(scene.model.mesh.nodes, 0.01));
    for (const int steps : {0, 1, 25}) {
        engine.run(steps, scene.coefficients);
        const Matrix3Xd u = engine.displacement(), v = engine.increment();
        const Matrix3Xd held = scene.conditions.imposed.cast<float>().cast<double>();
        EXPECT_EQ(scene.conditions.constrained.select(u, held), held) << steps;
        EXPECT_EQ(scene.conditions.constrained.select(v, scene.still), scene.still) << steps;
    }
}

// Before any state is set the imposed displacement is there already.
TEST_F(RenderPassesInUse, StartAtRestButForWhatIsImposed) {
    EXPECT_LT(largest(engine.displacement() - scene.conditions.imposed), 1e-6);
}

TEST_F(RenderPassesInUse, SayWhereTheyRun) {
    EXPECT_THAT(engine.description(), ::testing::MatchesRegex("GPU .* \\(OpenGL 4.5\\), render passes"));
}

/// The message with which the passes refuse a scene, empty when they take it.
std::string refusal(const Model& model, const Conditions& conditions = {}) {
    const RestState rest = rest_state(model);
    try {
        RenderPassEngine(rest, nodal_conditions(conditions, rest.node_count), lumped(rest));
    } catch (const InvalidInput& error) {
        return error.what();
    }
    return "";
}

// Whatever is accepted without being computed would be a wrong answer without a word.
TEST(RenderPassEngine, RefusesInWordsWhatItDoesNotKnow) {
    using ::testing::HasSubstr;
    EXPECT_EQ(refusal(cube(3, Element::T4, Laws::Iso)), "");
    EXPECT_THAT(refusal(cube(3, Element::T4, Laws::Mixed)), HasSubstr("several laws"));
    EXPECT_THAT(refusal(cube(3, Element::T4, Laws::Ogden)), HasSubstr("ogden"));
    EXPECT_THAT(refusal(cube(3, Element::T4, Laws::Fibres)), HasSubstr("transversely_isotropic"));
    EXPECT_THAT(refusal(cube(3, Element::AveragedPressureT4, Laws::Iso)), HasSubstr("averaged pressure"));
    Model viscous = cube(3, Element::T4, Laws::Iso);
    viscous.viscosity[1] = {{{0.3, 0.01}}};
    EXPECT_THAT(refusal(viscous), HasSubstr("viscosity"));
    Conditions spring;
    spring.springs.push_back({0, Matrix3d::Identity(), Vector3d::Zero()});
    EXPECT_THAT(refusal(cube(3, Element::T4, Laws::Iso), spring), HasSubstr("springs"));
    Conditions force;
    force.external_force = Matrix3Xd::Constant(3, 64, 0.1);
    EXPECT_THAT(refusal(cube(3, Element::T4, Laws::Iso), force), HasSubstr("external forces"));
}

TEST_F(RenderPassesInUse, RefuseWrongShapesMassesAndDevices) {
    const int nodes = scene.rest.node_count;
    const Matrix3Xd other = Matrix3Xd::Zero(3, nodes + 1), mass = lumped(scene.rest);
    EXPECT_THROW(engine.set_state(other, scene.still), InvalidInput);
    EXPECT_THROW(engine.set_state(scene.still, other), InvalidInput);
    EXPECT_THROW(RenderPassEngine(scene.rest, scene.conditions, Matrix3Xd::Ones(3, 1)), InvalidInput);
    EXPECT_THROW(RenderPassEngine(scene.rest, scene.conditions, scene.still), InvalidInput);
    EXPECT_THROW(RenderPassEngine(scene.rest, nodal_conditions({}, nodes + 1), mass), InvalidInput);
    EXPECT_THROW(RenderPassEngine(scene.rest, scene.conditions, mass, 1000), GpuUnavailable);
}

}  // namespace
}  // namespace tissuewarp::tled
