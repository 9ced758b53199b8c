/// Effects in every engine, alone, in pairs and all at once, against their plain float64 forces and the step written
/// out.
#include "meshing/primitives.hpp"
#include "tests/tled/engine_scene.hpp"
#include "tled/model/interpolation_reach.hpp"

#include <gmock/gmock.h>
#include <Eigen/Geometry>

#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <tuple>

namespace tissuewarp::tled {
namespace {

using namespace scene;
using Eigen::Matrix3Xi;
using ::testing::HasSubstr;

/// As in engine_scene.hpp, and a GPU whose one workgroup takes many steps over all patches in a dispatch, which a
/// software rasteriser runs too.
struct EngineUnderTest {
    const char* name;
    std::unique_ptr<Engine> (*make)(const RestState&);
};
constexpr GpuStepShape many_steps_at_once{.patch_tets = 100, .longest_fan = 5, .workgroup = 64, .at_once = 1};
const std::array<EngineUnderTest, 5> engines{{
    {"CpuFloat64", [](const RestState& rest) { return make_engine(Kind::CpuFloat64, rest); }},
    {"CpuFloat32", [](const RestState& rest) { return make_engine(Kind::CpuFloat32, rest); }},
    {"Gpu", [](const RestState& rest) { return make_gpu_engine(rest, -1, GpuStepShape{}); }},
    {"GpuPatches", [](const RestState& rest) { return make_engine(Kind::GpuPatches, rest); }},
    {"GpuPatchesManySteps", [](const RestState& rest) { return make_gpu_engine(rest, -1, many_steps_at_once); }},
}};

/// Turning is of bodies in contact.
enum Effect : unsigned {
    Pressures = 1,
    Membranes = 2,
    Sliding = 4,
    Fluids = 8,
    Contacts = 16,
    Turning = 32,
    Parting = 64
};
constexpr unsigned every_effect = 127;

std::string name_of_effects(unsigned effects) {
    std::string name;
    for (const auto& [effect, word] :
         {std::pair{Pressures, "Pressure"}, std::pair{Membranes, "Membrane"}, std::pair{Sliding, "Sliding"},
          std::pair{Fluids, "Fluid"}, std::pair{Contacts, "Contact"}, std::pair{Turning, "Turning"},
          std::pair{Parting, "Parting"}})
        if (effects & effect) name += word;
    return name.empty() ? "None" : name;
}

/// Each alone, every pair, all at once.
std::vector<unsigned> combinations() {
    std::vector<unsigned> all;
    for (unsigned effects = 1; effects <= every_effect; ++effects)
        if ((std::popcount(effects) <= 2 || effects == every_effect) && (!(effects & Turning) || effects & Contacts))
            all.push_back(effects);
    return all;
}

/// A body's distance on a grid of oblique steps of about 2 mm over the cube at `centre` and 12 mm around.
DistanceGrid sampled(const Vector3d& centre, const std::function<double(const Vector3d&)>& distance) {
    DistanceGrid grid;
    grid.steps << 2, 0.2, 0, -0.1, 1.9, 0.1, 0.15, 0, 2.1;
    grid.size = {28, 27, 26};
    grid.origin = centre - grid.steps * (0.5 * (grid.size.cast<double>() - Vector3d::Ones()));
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i)
                grid.distance.push_back(static_cast<float>(distance(grid.origin + grid.steps * Vector3d(i, j, k))));
    return grid;
}

/// A jittered cube of 30 mm a metre from the origin, where float32 positions would lose the last 0.06 µm.
struct Scene {
    Vector3d corner{1000, -700, 400};
    static inline const Vector3d wall_velocity{60, 5, -40};  // mm/s
    Model model;
    Matrix3Xd local;  ///< positions from the corner
    Conditions plain;
    RestState rest;

    explicit Scene(Element element) : model(cube(4, element, Laws::Iso)), local(model.mesh.nodes) {
        plain = mixed_conditions(model.mesh);
        model.mesh.nodes.colwise() += corner;
        rest = rest_state(model);
    }

    [[nodiscard]] Matrix3Xi boundary_faces() const {
        const meshing::BoundarySurface boundary = meshing::boundary_surface(model.mesh);
        Matrix3Xi faces = boundary.surface.triangles;
        for (int& node : faces.reshaped()) node = boundary.node_of[static_cast<std::size_t>(node)];
        return faces;
    }

    [[nodiscard]] Matrix3Xd start() const { return wavy(local, 0.3); }

    /// A body by its distance up to a constant, grown until it is 0.02 mm from where the tissue starts: a node that
    /// starts inside would be thrown out at its depth a step.
    [[nodiscard]] Obstacle touching(const std::function<double(const Vector3d&)>& distance,
                                    const RigidPlacement& placement, double friction) const {
        double least = std::numeric_limits<double>::infinity();
        const Matrix3Xd x = model.mesh.nodes + start();
        for (Eigen::Index a = 0; a < x.cols(); ++a) least = std::min(least, distance(x.col(a)));
        const auto& [shift, rotation] = placement;
        const Vector3d middle = rotation.transpose() * (corner + Vector3d(15, 15, 15) - shift);
        const auto from_body = [&](const Vector3d& at) { return distance(rotation * at + shift) - least + 0.02; };
        return {sampled(middle, from_body), placement, friction};
    }

    /// A slightly oblique wall with friction that the tissue bulges into, and a ball without that was moved to its
    /// place. They were sampled where these placements have taken them from.
    [[nodiscard]] RigidContact contact(const RigidPlacement& of_wall, RigidPlacement of_ball,
                                       const RigidVelocity& velocity_of_wall) const {
        RigidContact contact;
        for (int node = 0; node < rest.node_count; ++node) contact.nodes.push_back(node);
        const Vector3d n = Vector3d(0.05, -1, 0.02).normalized(), ball = corner + Vector3d(45, 17, 16);
        contact.obstacles.push_back(touching([&](const Vector3d& x) { return n.dot(x); }, of_wall, 0.3));
        contact.obstacles.back().velocity = velocity_of_wall;
        of_ball.shift += Vector3d(4, -1, 2);
        contact.obstacles.push_back(touching([&](const Vector3d& x) { return (x - ball).norm(); }, of_ball, 0.0));
        return contact;
    }

    /// The same as bodies that have turned, the wall about an axis through the tissue and on the way on.
    [[nodiscard]] RigidContact turning_contact() const {
        return contact(turned(0.7), turned(-1.1), spinning_about(corner + Vector3d(15, 0, 15), {2, -9, 4}));
    }

    /// By an angle about an oblique axis through the cube.
    [[nodiscard]] RigidPlacement turned(double angle) const {
        const Eigen::Matrix3d R = Eigen::AngleAxisd(angle, Vector3d(1, 2, -2) / 3).toRotationMatrix();
        const Vector3d point = corner + Vector3d(10, 20, 5);
        return {point - R * point, R};
    }

    static RigidVelocity spinning_about(const Vector3d& point, const Vector3d& spin) {
        return {wall_velocity - spin.cross(point), spin};
    }

    /// Some press on one another where the tests start, some are apart.
    static std::vector<SlidingPair> pairs_that_may_part(const Vector3d& n) {
        return {{31, 93, n, 6.0}, {93, 31, n, 5.0}, {92, 66, Vector3d::UnitZ(), 5.0}, {66, 92, Vector3d::UnitZ(), 3.0},
                {58, 66, n, 6.0}, {66, 58, n, 5.0}, {61, 92, Vector3d::UnitX(), 5.0}, {92, 61, Vector3d::UnitX(), 2.0}};
    }

    [[nodiscard]] Conditions conditions(unsigned effects) const {
        Conditions conditions = plain;
        const Matrix3Xi faces = boundary_faces(), half = faces.leftCols(faces.cols() / 2);
        if (effects & Pressures) conditions.effects.pressures = {{faces, 0.4}, {half, -0.3}};
        if (effects & Membranes) conditions.effects.membranes = {{faces, 12.0, 0.5}, {half, 20.0, 0.2}};
        const Vector3d n = Vector3d(1, -2, 0.5).normalized();
        if (effects & Sliding)
            conditions.effects.sliding = {{60, 62, n, 6.0}, {62, 87, Vector3d::UnitZ(), 5.0}, {90, 60, n, 4.0}};
        if (effects & Parting) conditions.effects.parting = pairs_that_may_part(n);
        if (effects & Fluids)
            conditions.effects.fluid =
                Fluid{1e-6,
                      {1000, 2000, -9500},
                      Vector3d(-1000, -2000, 9500).normalized().dot(corner + Vector3d(15, 15, 17))};
        if (effects & Contacts) conditions.effects.contact = contact({}, {}, {wall_velocity});
        if (effects & Turning) conditions.effects.contact = turning_contact();
        return conditions;
    }

    [[nodiscard]] NodalConditions nodal(unsigned effects) const { return nodal_conditions(conditions(effects), rest); }
};

Matrix3Xd effect_force(const RestState& rest, const NodalConditions& conditions, const Matrix3Xd& u) {
    Matrix3Xd force = surface_force(conditions.effects.surface, rest.position, u);
    if (conditions.effects.fluid) force += fluid_force(*conditions.effects.fluid, u);
    return force;
}

/// f_ext + f_spring + effects − f_int in plain float64.
Matrix3Xd whole_residual(const RestState& rest, const NodalConditions& conditions, const Matrix3Xd& u) {
    const Matrix3Xd zero = Matrix3Xd::Zero(3, rest.node_count);
    return plain_residual(rest, conditions, u) + conditions.constrained.select(zero, effect_force(rest, conditions, u));
}

void settle(const NodalConditions& conditions, double time_step, PlainState& state) {
    if (!conditions.effects.contact) return;
    const NodalContact& contact = *conditions.effects.contact;
    for (std::size_t i = 0; i < contact.node.size(); ++i) {
        const int a = contact.node[i];
        const Motion motion = in_contact(contact.obstacles, contact.rest_position.col(static_cast<Eigen::Index>(i)),
                                         {state.u.col(a), state.v.col(a)}, time_step);
        for (int c = 0; c < 3; ++c) {
            if (conditions.constrained(c, a)) continue;
            state.u(c, a) = motion.u[c];
            state.v(c, a) = motion.v[c];
        }
    }
}

/// u⁺ = u + ρ v + c M⁻¹ r, then contact.
void plain_steps(const RestState& rest, const NodalConditions& conditions, int steps,
                 const StepCoefficients& coefficients, PlainState& state) {
    state.u = conditions.constrained.select(conditions.imposed, state.u).eval();
    state.v = conditions.constrained.select(Matrix3Xd::Zero(3, rest.node_count), state.v).eval();
    for (int step = 0; step < steps; ++step) {
        const Matrix3Xd residual = whole_residual(rest, conditions, state.u);
        state.v = coefficients.momentum * state.v + coefficients.gain * residual.cwiseQuotient(lumped(rest)).eval();
        state.u += state.v;
        settle(conditions, coefficients.time_step, state);
    }
}

class EffectsInEngines : public ::testing::TestWithParam<std::tuple<EngineUnderTest, Element, unsigned>> {
protected:
    EffectsInEngines() { coefficients.time_step = 1e-3; }  // in which the wall goes 0.07 mm

    unsigned effects = std::get<2>(GetParam());
    Scene scene{std::get<1>(GetParam())};
    const RestState& rest = scene.rest;
    Matrix3Xd zero = Matrix3Xd::Zero(3, rest.node_count);
    NodalConditions conditions = scene.nodal(effects);
    StepCoefficients coefficients = stable_coefficients(scene.model, rest);
    Matrix3Xd start = scene.start();

    [[nodiscard]] std::unique_ptr<Engine> fresh_engine() const { return std::get<0>(GetParam()).make(rest); }
    std::unique_ptr<Engine> engine = fresh_engine();
};

std::string name_of_case(const ::testing::TestParamInfo<EffectsInEngines::ParamType>& each) {
    return std::string(std::get<0>(each.param).name) + name_of(std::get<1>(each.param)) +
           name_of_effects(std::get<2>(each.param));
}

INSTANTIATE_TEST_SUITE_P(T4, EffectsInEngines,
                         ::testing::Combine(::testing::ValuesIn(engines), ::testing::Values(Element::T4),
                                            ::testing::ValuesIn(combinations())),
                         name_of_case);
// Other dispatches of patches.
INSTANTIATE_TEST_SUITE_P(AveragedPressure, EffectsInEngines,
                         ::testing::Combine(::testing::ValuesIn(engines),
                                            ::testing::Values(Element::AveragedPressureT4),
                                            ::testing::Values(Fluids | Contacts, every_effect)),
                         name_of_case);

// A wrong sign or node looks like an error of the order of the force itself, 10 to 100 %.
TEST_P(EffectsInEngines, ResidualIsThePlainOne) {
    engine->set_conditions(conditions);
    std::mt19937 random(7);
    std::uniform_real_distribution<double> noise(-0.3, 0.3);
    const Matrix3Xd bent = wavy(scene.local), u = bent + zero.unaryExpr([&](double) { return noise(random); });
    for (const Matrix3Xd& at : {u, bent}) {
        engine->set_state(at, zero);
        const Matrix3Xd held = conditions.constrained.select(conditions.imposed, at);
        const Matrix3Xd expected = whole_residual(rest, conditions, held);
        EXPECT_LT(largest(engine->residual() - expected), 1e-5 * largest(internal_force(rest, held)));
        // Reactions are of the tissue alone.
        const Matrix3Xd internal = internal_force(rest, held);
        EXPECT_LT(largest(engine->internal_force() - internal), 1e-5 * largest(internal));
    }
}

// Edges of float32 positions a metre away would be off by 6e-5 mm, a tenth of the strain here; a membrane that takes
// the difference of F and F C⁻¹/det C loses four of seven digits.
TEST_P(EffectsInEngines, SmallStrainsKeepTheirDigits) {
    const Matrix3Xd u = wavy(scene.local, 1e-3);
    const auto force_of = [&](const NodalConditions& each) -> Matrix3Xd {
        engine->set_conditions(each);
        engine->set_state(u, zero);
        return engine->residual();
    };
    // Nothing but effects acts, next to internal forces that are as small.
    const NodalConditions bare = nodal_conditions({}, rest);
    NodalConditions with = bare;
    with.effects = conditions.effects;
    const Matrix3Xd expected = effect_force(rest, with, u);
    const Matrix3Xd force = force_of(with) - force_of(bare);
    EXPECT_LT(largest(force - expected), 1e-5 * largest(expected) + 1e-6 * largest(internal_force(rest, u)));
}

TEST_P(EffectsInEngines, AHundredStepsFollowThePlainLoop) {
    engine->set_conditions(conditions);
    engine->set_state(start, zero);
    engine->run(100, coefficients);
    PlainState plain{start, zero, zero};
    plain_steps(rest, conditions, 100, coefficients, plain);
    PlainState without{start, zero, zero};
    plain_steps(rest, scene.nodal(0), 100, coefficients, without);
    EXPECT_GT(largest(plain.u - without.u), 0.01 * largest(plain.u)) << "the effects do not matter here";
    EXPECT_LT(largest(engine->displacement() - plain.u), 1e-5 * largest(plain.u));
    EXPECT_LT(largest(engine->increment() - plain.v), 2e-4 * largest(plain.v));
}

TEST_P(EffectsInEngines, RepeatsBitByBitAndInPortions) {
    const auto run = [&](Engine& each, std::initializer_list<int> portions) {
        each.set_conditions(conditions);
        each.set_state(start, zero);
        for (const int steps : portions) {
            each.run(steps, coefficients);
            each.residual();
        }
        return std::pair{each.displacement(), each.increment()};
    };
    const auto first = run(*engine, {60});
    EXPECT_EQ(run(*engine, {60}), first);
    EXPECT_EQ(run(*engine, {1, 12, 47}), first);
    EXPECT_EQ(run(*fresh_engine(), {60}), first);
}

TEST_P(EffectsInEngines, NothingIsLeftOfEffectsThatAreGone) {
    const auto plain_run = [&](Engine& each) {
        each.set_conditions(scene.nodal(0));
        each.set_state(start, zero);
        each.run(40, coefficients);
        return std::tuple{each.displacement(), each.increment(), each.observe().increment_stiffness};
    };
    engine->set_conditions(conditions);
    engine->set_state(start, zero);
    engine->run(20, coefficients);
    EXPECT_EQ(plain_run(*engine), plain_run(*fresh_engine()));
}

// Loads that grow and bodies that move keep what is as large as before; what they leave looks like another answer.
TEST_P(EffectsInEngines, NothingIsLeftOfEffectsThatHaveChanged) {
    Conditions before = scene.conditions(effects);
    for (SurfacePressure& each : before.effects.pressures) {
        each.pressure *= -2;
        each.faces = each.faces.rowwise().reverse().eval();
    }
    for (Membrane& each : before.effects.membranes) each.thickness *= 3;
    for (SlidingPair& each : before.effects.sliding) std::swap(each.first, each.second);
    for (SlidingPair& each : before.effects.parting) std::swap(each.first, each.second);
    if (before.effects.fluid) before.effects.fluid->level += 5;
    if (before.effects.contact)
        for (Obstacle& each : before.effects.contact->obstacles) {
            each.placement.shift += Vector3d(0.5, 0.5, -0.5);
            each.placement.rotation = Eigen::AngleAxisd(0.01, Vector3d::UnitX()) * each.placement.rotation;
            each.velocity.of_origin *= -1;
            each.velocity.spin *= -1;
        }
    const auto run = [&](Engine& each) {
        each.set_conditions(conditions);
        each.set_state(start, zero);
        each.run(40, coefficients);
        return std::tuple{each.displacement(), each.increment(), each.residual()};
    };
    engine->set_conditions(nodal_conditions(before, rest));
    engine->set_state(start, zero);
    engine->run(5, coefficients);
    EXPECT_EQ(run(*engine), run(*fresh_engine()));
}

// Where some effects take other passes than the rest, each goes on from where the other stopped.
TEST_P(EffectsInEngines, EffectsMayComeAndGoBetweenRuns) {
    PlainState plain{start, zero, zero};
    engine->set_state(start, zero);
    const unsigned contact = effects & Contacts;  // nodes must not have entered before it begins
    for (const unsigned now : {contact, effects, contact, contact | Fluids, effects, 0U}) {
        const NodalConditions here = scene.nodal(now);
        engine->set_conditions(here);
        engine->run(25, coefficients);
        plain_steps(rest, here, 25, coefficients, plain);
    }
    EXPECT_LT(largest(engine->displacement() - plain.u), 1e-5 * largest(plain.u));
}

/// Whether any pass names the effect: a chunk of the GPU's programs or an argument of the CPU's.
bool names(const std::vector<StepPass>& passes, const std::string& effect) {
    return std::any_of(passes.begin(), passes.end(), [&](const StepPass& pass) {
        return std::any_of(pass.parts.begin(), pass.parts.end(),
                           [&](const std::string& part) { return part.find(effect) != std::string::npos; });
    });
}

// A failure looks like: a chunk of an effect in the program of a scene that lacks it, or a scene whose effect no pass
// knows.
TEST_P(EffectsInEngines, StepPassesNameWhatTheSceneHasAndNothingElse) {
    engine->set_conditions(conditions);
    const std::vector<StepPass> passes = engine->step_passes();
    ASSERT_GE(passes.size(), 1u);
    for (const auto& [effect, word] :
         {std::pair{Pressures, "pressure"}, std::pair{Membranes, "membrane"}, std::pair{Sliding, "sliding"},
          std::pair{Fluids, "fluid"}, std::pair{Contacts, "contact"}, std::pair{Turning, "turning"},
          std::pair{Parting, "parting"}}) {
        const bool gpu = engine->processor() == Processor::Gpu,
                   on_surface = (effect & (Pressures | Membranes | Sliding | Parting)) != 0;
        const std::string part = !gpu ? word : std::string(on_surface ? "surface." : "node.") + word;
        if (part == "pressure" && std::get<1>(GetParam()) != Element::T4)
            continue;  // averaged pressure is another thing
        EXPECT_EQ(names(passes, part), (effects & effect) != 0) << part;
    }
    for (const StepPass& pass : passes) {
        EXPECT_GT(pass.invocations, 0u) << pass.program;
        for (const StepBuffer& buffer : pass.buffers) EXPECT_GT(buffer.bytes, 0u) << buffer.name;
    }
    engine->set_conditions(scene.nodal(0));
    for (const char* word : {"membrane", "sliding", "parting", "fluid", "contact", "turning", "surface"})
        EXPECT_FALSE(names(engine->step_passes(), word)) << word;
}

TEST(GpuEffects, SurfaceEffectsTakeTwoPassesWhileTheyLast) {
    const Scene scene(Element::T4);
    const auto engine = make_engine(Kind::GpuPatches, scene.rest);
    EXPECT_THAT(engine->description(), HasSubstr("patches"));
    for (const unsigned effect : {Pressures, Membranes, Sliding, Parting}) {
        engine->set_conditions(scene.nodal(effect));
        EXPECT_THAT(engine->description(), HasSubstr("two passes")) << name_of_effects(effect);
        engine->set_conditions(scene.nodal(Fluids | Contacts));
        EXPECT_THAT(engine->description(), HasSubstr("patches"));
    }
}

// Contact looks at one sample before it takes 64. Too small a reach looks like a node deep inside an obstacle.
TEST(GpuEffects, NoInterpolationIsFurtherBelowTheNearestSampleThanTheReach) {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> noise(-1, 1), part(0, 1);
    double closest = 0;
    for (int trial = 0; trial < 200; ++trial) {
        DistanceGrid grid;
        grid.size = {4, 4, 4};
        // Samples that alternate come closest to the bound.
        for (int i = 0; i < 64; ++i)
            grid.distance.push_back(static_cast<float>(((i + i / 4 + i / 16) % 2 == 0 ? 1 : -1) + 0.3 * noise(random)));
        const double reach = detail::interpolation_reach(grid);
        const double steepness = detail::interpolation_steepness(grid);
        const Obstacle obstacle{grid};
        for (int point = 0; point < 50; ++point) {
            const Vector3d x(1 + part(random), 1 + part(random), 1 + part(random));
            const auto nearest = [&](int axis) { return static_cast<std::size_t>(std::lround(x[axis])); };
            const double sample = double{grid.distance[nearest(0) + 4 * (nearest(1) + 4 * nearest(2))]};
            const double below = sample - distance_to(obstacle, x).value;
            ASSERT_LT(below, reach);
            ASSERT_LT(distance_to(obstacle, x).gradient.norm(), steepness);
            closest = std::max(closest, below / reach);
        }
    }
    EXPECT_GT(closest, 0.1) << "the test does not come near the bound";
}

// Nodes that touch an obstacle go by its tangent. Too long a reach looks like a node that sinks into a curved wall.
TEST(GpuEffects, NoDistanceStraysFurtherFromItsTangentThanTheReachAllows) {
    std::mt19937 random(4);
    std::uniform_real_distribution<double> noise(-1, 1), part(0, 1);
    constexpr double tolerance = 1e-3;
    double furthest = 0;
    for (int trial = 0; trial < 200; ++trial) {
        DistanceGrid grid;
        grid.size = {6, 6, 6};
        for (int i = 0; i < 216; ++i) grid.distance.push_back(static_cast<float>(0.3 * noise(random)));
        const double reach = detail::tangent_reach(grid, tolerance);
        const Obstacle obstacle{grid};
        for (int point = 0; point < 50; ++point) {
            const Vector3d x(2 + part(random), 2 + part(random), 2 + part(random));
            const Vector3d way = reach * Vector3d(noise(random), noise(random), noise(random)).normalized();
            const Distance here = distance_to(obstacle, x);
            const double off = distance_to(obstacle, x + way).value - here.value - here.gradient.dot(way);
            ASSERT_LT(std::abs(off), tolerance);
            furthest = std::max(furthest, std::abs(off));
        }
    }
    EXPECT_GT(furthest, 0.05 * tolerance) << "the test does not come near the bound";
}

}  // namespace
}  // namespace tissuewarp::tled
