/// Every method on every engine against Newton's method, on the cube of Taylor, Cheng and Ourselin (2007).
#include "tests/tled/engine_scene.hpp"
#include "tests/tled/equilibrium_scenes.hpp"
#include "tled/reference/newton.hpp"

#include <gmock/gmock.h>
#include <tbb/global_control.h>
#include <Eigen/Geometry>

#include <cmath>
#include <functional>
#include <string>

namespace tissuewarp::tled {
namespace {

using Eigen::Matrix3Xd;

class SeedCubes : public ::testing::TestWithParam<Element> {
protected:
    SeedCube cube{GetParam()};
    RestStiffness stiffness{cube.rest, cube.conditions};
    Matrix3Xd newton = newton_equilibrium(cube.rest, cube.conditions, {.tolerance_mm = 1e-10}).displacement;

    /// Largest difference to Newton's solution over the largest displacement, 20 mm.
    double relative_error(Engine& engine, double tolerance_mm) {
        const auto found =
            equilibrium(engine, stiffness, cube.conditions, {.tolerance_mm = tolerance_mm, .max_steps = 60000});
        EXPECT_LE(found.estimated_error_mm, tolerance_mm);
        return largest_difference(found.displacement, newton) / 20;
    }
};

INSTANTIATE_TEST_SUITE_P(Elements, SeedCubes, ::testing::Values(Element::T4, Element::AveragedPressureT4),
                         [](const auto& each) { return each.param == Element::T4 ? "T4" : "AveragedPressure"; });

TEST_P(SeedCubes, CpuFloat64AgreesWithNewtonTo1em8) {
    EXPECT_LT(relative_error(*make_cpu_engine(cube.rest, Scalar::Float64), 5e-8), 1e-8);
}

TEST_P(SeedCubes, CpuFloat32AgreesWithNewtonTo1em4) {
    EXPECT_LT(relative_error(*make_cpu_engine(cube.rest, Scalar::Float32), 1e-3), 1e-4);
}

TEST_P(SeedCubes, GpuAgreesWithNewtonTo1em4) {
    EXPECT_LT(relative_error(*make_gpu_engine(cube.rest), 1e-3), 1e-4);
}

TEST_P(SeedCubes, EstimatedErrorIsTheTrueError) {
    const auto engine = make_cpu_engine(cube.rest, Scalar::Float64);
    for (const double tolerance : {0.3, 0.03, 0.003}) {
        const auto found = equilibrium(*engine, stiffness, cube.conditions, {.tolerance_mm = tolerance});
        const double error = largest_difference(found.displacement, newton);
        EXPECT_LT(error, 2 * tolerance) << tolerance;
        EXPECT_THAT(found.estimated_error_mm / error, ::testing::AllOf(::testing::Gt(0.5), ::testing::Lt(2.0)))
            << tolerance;
    }
}

using MethodOnEngine = std::tuple<EquilibriumMethod, scene::Kind>;

class EquilibriumMethods : public ::testing::TestWithParam<MethodOnEngine> {
protected:
    EquilibriumMethod method = std::get<0>(GetParam());
    scene::Kind kind = std::get<1>(GetParam());
    bool exact = kind == scene::Kind::CpuFloat64;
};

std::string name_of_case(const ::testing::TestParamInfo<MethodOnEngine>& each) {
    const auto method = std::get<0>(each.param);
    const char* name = method == EquilibriumMethod::Lbfgs               ? "Lbfgs"
                       : method == EquilibriumMethod::DynamicRelaxation ? "Relaxation"
                                                                        : "SelfCheckedRelaxation";
    return std::string(name) + scene::name_of(std::get<1>(each.param));
}
const auto all_methods = ::testing::Values(EquilibriumMethod::Lbfgs, EquilibriumMethod::DynamicRelaxation,
                                           EquilibriumMethod::SelfCheckedRelaxation);

INSTANTIATE_TEST_SUITE_P(All, EquilibriumMethods,
                         ::testing::Combine(all_methods, ::testing::Values(scene::Kind::CpuFloat64,
                                                                           scene::Kind::CpuFloat32, scene::Kind::Gpu)),
                         name_of_case);

/// float64 forces reach any sensible tolerance.
class EquilibriumMethodsInFloat32 : public EquilibriumMethods {};
INSTANTIATE_TEST_SUITE_P(All, EquilibriumMethodsInFloat32,
                         ::testing::Combine(all_methods, ::testing::Values(scene::Kind::CpuFloat32, scene::Kind::Gpu)),
                         name_of_case);

/// Two laws, springs, forces, whole and partial prescribed displacements.
struct MixedScene {
    Model model = scene::cube(4, Element::AveragedPressureT4, scene::Laws::Mixed);
    RestState rest = rest_state(model);
    NodalConditions conditions = nodal_conditions(scene::mixed_conditions(model.mesh), rest.node_count);
    RestStiffness stiffness{rest, conditions};
    Matrix3Xd newton = newton_equilibrium(rest, conditions, {.tolerance_mm = 1e-10}).displacement;
};

TEST_P(EquilibriumMethods, AgreeWithNewtonToTheTolerance) {
    const MixedScene scene;
    const auto engine = scene::make_engine(kind, scene.rest);
    for (const double tolerance : {0.03, exact ? 1e-7 : 1e-3}) {
        const auto found = equilibrium(*engine, scene.stiffness, scene.conditions,
                                       {.tolerance_mm = tolerance, .max_steps = 20000, .method = method});
        EXPECT_EQ(found.method, method);
        EXPECT_LE(found.estimated_error_mm, tolerance);
        EXPECT_LT(largest_difference(found.displacement, scene.newton), 1.5 * tolerance);
        EXPECT_NEAR(found.min_jacobian, jacobians(scene.rest, scene.newton).minCoeff(), 0.05);
    }
}

TEST_P(EquilibriumMethods, TakeOtherSpringsThanThoseFactorised) {
    const MixedScene scene;
    NodalConditions other = scene.conditions;
    for (Eigen::Index s = 0; s < other.spring_stiffness.cols(); ++s) {
        const double factor = s % 2 == 0 ? 0.1 : 2.0;
        other.spring_stiffness.col(s) *= factor;
        other.spring_force.col(s) *= factor;
    }
    const Matrix3Xd newton = newton_equilibrium(scene.rest, other, {.tolerance_mm = 1e-9}).displacement;
    const auto engine = scene::make_engine(kind, scene.rest);
    const auto found = equilibrium(*engine, scene.stiffness, other, {.tolerance_mm = 2e-3, .method = method});
    EXPECT_LT(largest_difference(found.displacement, newton), 3e-3);
}

TEST_P(EquilibriumMethods, GoOnFromAStart) {
    const MixedScene scene;
    const auto engine = scene::make_engine(kind, scene.rest);
    const EquilibriumOptions options{.tolerance_mm = 2e-3, .method = method};
    const auto cold = equilibrium(*engine, scene.stiffness, scene.conditions, options);
    const auto warm = equilibrium(*engine, scene.stiffness, scene.conditions, options, &scene.newton);
    EXPECT_LT(largest_difference(warm.displacement, scene.newton), 2e-3);
    EXPECT_LE(warm.force_evaluations, method == EquilibriumMethod::SelfCheckedRelaxation ? 60 : 3);
    EXPECT_LT(warm.force_evaluations, cold.force_evaluations);
}

TEST_P(EquilibriumMethods, GiveATrustworthyDisplacementOrRefuse) {
    // Loads from nothing to absurd: whatever comes back is finite, without inverted tissue, and balanced.
    const SeedCube cube(Element::AveragedPressureT4, 3);
    const RestStiffness stiffness(cube.rest, cube.conditions);
    const auto engine = scene::make_engine(kind, cube.rest);
    int refused = 0;
    for (const double force : {0.0, 1.0, 30.0, 1e3, 1e6, 1e30, 1e300}) {
        NodalConditions loaded = cube.conditions;
        loaded.external_force.row(0).setConstant(force);
        try {
            const auto found =
                equilibrium(*engine, stiffness, loaded, {.tolerance_mm = 0.01, .max_steps = 3000, .method = method});
            EXPECT_TRUE(found.displacement.allFinite()) << force;
            EXPECT_GT(jacobians(cube.rest, found.displacement).minCoeff(), 0) << force;
            EXPECT_TRUE(std::isfinite(found.estimated_error_mm)) << force;
        } catch (const SolverFailure& failure) {
            ++refused;
            EXPECT_THAT(failure.what(), ::testing::HasSubstr("good state")) << force;
            EXPECT_THAT(failure.what(), ::testing::Not(::testing::HasSubstr("nan"))) << force;
        }
    }
    EXPECT_GE(refused, 3);
    const auto again = equilibrium(*engine, stiffness, cube.conditions, {.tolerance_mm = 0.01, .method = method});
    const Matrix3Xd newton = newton_equilibrium(cube.rest, cube.conditions).displacement;
    EXPECT_LT(largest_difference(again.displacement, newton), 0.015);  // the engine forgot what it went through
}

std::string refusal_of(const std::function<void()>& call) {
    try {
        call();
    } catch (const Error& error) {
        return error.what();
    }
    return "accepted";
}

TEST_P(EquilibriumMethodsInFloat32, SayWhenThePrecisionOfForcesEnds) {
    const MixedScene scene;
    const auto engine = scene::make_engine(kind, scene.rest);
    EXPECT_THAT(refusal_of([&] {
                    (void)equilibrium(*engine, scene.stiffness, scene.conditions,
                                      {.tolerance_mm = 1e-11, .max_steps = 20000, .method = method});
                }),
                ::testing::AllOf(::testing::HasSubstr("float32"), ::testing::HasSubstr("larger tolerance")));
}

TEST_P(EquilibriumMethods, NameTheTetrahedronThatALoadInverts) {
    const SeedCube cube(Element::T4, 3);
    const RestStiffness stiffness(cube.rest, cube.conditions);
    NodalConditions crushed = cube.conditions;
    crushed.imposed *= -5.5;  // the top 10 mm below the bottom
    const auto engine = scene::make_engine(kind, cube.rest);
    EXPECT_THAT(refusal_of([&] { (void)equilibrium(*engine, stiffness, crushed, {.method = method}); }),
                ::testing::AllOf(::testing::HasSubstr("tetrahedron"), ::testing::HasSubstr("det F"),
                                 ::testing::HasSubstr("load in parts")));
}

TEST_P(EquilibriumMethods, StopAfterTheAllowedEvaluations) {
    const MixedScene scene;
    const auto engine = scene::make_engine(kind, scene.rest);
    EXPECT_THAT(refusal_of([&] {
                    (void)equilibrium(*engine, scene.stiffness, scene.conditions,
                                      {.tolerance_mm = 1e-5, .max_steps = 4, .method = method});
                }),
                ::testing::AllOf(::testing::HasSubstr("4 force evaluations"), ::testing::HasSubstr("last good state")));
}

TEST(Equilibrium, ExplainsTheMethodThatItChose) {
    const MixedScene scene;
    for (const scene::Kind kind : {scene::Kind::CpuFloat32, scene::Kind::Gpu}) {
        Listener listener;
        const auto engine = scene::make_engine(kind, scene.rest);
        const auto found =
            equilibrium(*engine, scene.stiffness, scene.conditions, {.tolerance_mm = 0.01}, nullptr, listener);
        EXPECT_NE(found.method, EquilibriumMethod::Automatic);
        ASSERT_FALSE(listener.notes.empty());
        EXPECT_THAT(listener.notes.front(), ::testing::HasSubstr(found.reason));
        EXPECT_THAT(listener.notes.front(), ::testing::HasSubstr(name_of(found.method)));
        if (kind == scene::Kind::Gpu) {
            EXPECT_EQ(found.method, EquilibriumMethod::SelfCheckedRelaxation);
            EXPECT_THAT(found.reason, ::testing::HasSubstr("factor"));
        }
    }
}

/// A held cube whose top is sheared: nearly incompressible.
struct StiffVolume {
    Model model;
    RestState rest;
    NodalConditions conditions;
    explicit StiffVolume(double poisson) {
        model.mesh = meshing::box_mesh({60, 60, 60}, {6, 6, 6}, 0.2, 1);
        model.materials[1] = neo_hookean_lnj(3.0, poisson);
        rest = rest_state(model);
        Conditions held;
        for (int node = 0; node < rest.node_count; ++node) {
            const double z = model.mesh.nodes(2, node);
            if (z < 1e-9) held.prescribed.push_back({node, {true, true, true}, {0, 0, 0}});
            if (z > 60 - 1e-9) held.prescribed.push_back({node, {true, true, true}, {9, 0, -2}});
        }
        conditions = nodal_conditions(held, rest.node_count);
    }
};

TEST(Equilibrium, AMetricNearTheAnswerSavesMostEvaluationsOfNearlyIncompressibleTissue) {
    const StiffVolume cube(0.499);
    const RestStiffness stiffness(cube.rest, cube.conditions);
    const Matrix3Xd newton = newton_equilibrium(cube.rest, cube.conditions, {.tolerance_mm = 1e-8}).displacement;
    const auto engine = make_cpu_engine(cube.rest, Scalar::Float64);
    EquilibriumOptions options{.tolerance_mm = 1e-3, .method = EquilibriumMethod::Lbfgs};
    const auto plain = equilibrium(*engine, stiffness, cube.conditions, options);
    options.rest = &cube.rest;
    Listener listener;
    const auto renewed = equilibrium(*engine, stiffness, cube.conditions, options, nullptr, listener);
    EXPECT_LT(largest_difference(plain.displacement, newton), 1.5e-3);
    EXPECT_LT(largest_difference(renewed.displacement, newton), 1.5e-3);
    EXPECT_LT(3 * renewed.force_evaluations, plain.force_evaluations);
    EXPECT_THAT(listener.notes, ::testing::Contains(::testing::HasSubstr("incompressible")));
}

TEST(Equilibrium, LbfgsNeedsFewEvaluations) {
    const StiffVolume cube(0.49);
    const RestStiffness stiffness(cube.rest, cube.conditions);
    const auto engine = make_cpu_engine(cube.rest, Scalar::Float32);
    const auto found =
        equilibrium(*engine, stiffness, cube.conditions, {.tolerance_mm = 0.01, .method = EquilibriumMethod::Lbfgs});
    EXPECT_LE(found.force_evaluations, 24);
}

TEST(Equilibrium, RefusesWhatCannotBeUsed) {
    const MixedScene scene;
    const auto engine = make_cpu_engine(scene.rest, Scalar::Float64);
    const auto refused = [&](const EquilibriumOptions& options, const Matrix3Xd* start) {
        return refusal_of([&] { (void)equilibrium(*engine, scene.stiffness, scene.conditions, options, start); });
    };
    EXPECT_THAT(refused({.tolerance_mm = 0}, nullptr), ::testing::HasSubstr("tolerance"));
    EXPECT_THAT(refused({.tolerance_mm = std::nan("")}, nullptr), ::testing::HasSubstr("tolerance"));
    EXPECT_THAT(refused({.max_steps = 0}, nullptr), ::testing::HasSubstr("positive"));
    Matrix3Xd start = scene.newton;
    start(1, 7) = std::nan("");
    EXPECT_THAT(refused({}, &start), ::testing::HasSubstr("not finite"));
    start = scene.newton.leftCols(5);
    EXPECT_THAT(refused({}, &start), ::testing::HasSubstr("5 columns"));
    start = 100 * scene::wavy(scene.model.mesh.nodes);
    EXPECT_THAT(refused({}, &start),
                ::testing::AllOf(::testing::HasSubstr("start"), ::testing::HasSubstr("tetrahedron")));
}

TEST(Equilibrium, NamesFreeRigidMotions) {
    const MixedScene scene;
    const auto engine = make_cpu_engine(scene.rest, Scalar::Float64);
    NodalConditions free = scene.conditions;
    free.constrained.setConstant(false);
    free.spring_stiffness.setZero();
    EXPECT_THAT(refusal_of([&] { (void)equilibrium(*engine, scene.stiffness, free, {.rest = &scene.rest}); }),
                ::testing::AnyOf(::testing::HasSubstr("rigid"), ::testing::HasSubstr("nothing holds")));
}

TEST(Equilibrium, AnEngineThatBlewUpIsUsableAgain) {
    const SeedCube cube(Element::T4, 3);
    for (const scene::Kind kind : {scene::Kind::CpuFloat64, scene::Kind::CpuFloat32, scene::Kind::Gpu}) {
        const auto engine = scene::make_engine(kind, cube.rest);
        engine->set_conditions(cube.conditions);
        engine->run(400, {0.99, 1e6});
        EXPECT_FALSE(engine->observe().finite);
        engine->set_state(Matrix3Xd::Zero(3, cube.rest.node_count), Matrix3Xd::Zero(3, cube.rest.node_count));
        engine->run(1, {0, 0});
        EXPECT_TRUE(engine->observe().finite) << scene::name_of(kind);
    }
}

TEST(Equilibrium, SpringsPullHalfwayAgainstTissueOfTheirOwnStiffness) {
    // A bar held at one end and pulled by springs of stiffness k at the other moves by t k / (k + K) in the linear
    // limit.
    Model model;
    model.mesh = meshing::box_mesh({40, 10, 10}, {8, 2, 2});
    model.materials[1] = neo_hookean_lnj(3.0, 0.0);
    model.element = Element::T4;
    const RestState rest = rest_state(model);
    const double bar = 3.0 * 100 / 40, target = 0.02;  // mN/mm, mm
    Conditions conditions;
    for (int node = 0; node < rest.node_count; ++node) {
        const Eigen::Vector3d X = model.mesh.nodes.col(node);
        if (X.x() > 1e-9) continue;
        PrescribedDisplacement held{node, {true, false, false}, {0, 0, 0}};
        if (X.norm() < 1e-9) held.constrained = {true, true, true};
        if (X.y() > 9 && X.z() < 1e-9) held.constrained = {true, false, true};
        conditions.prescribed.push_back(held);
    }
    // A third of the triangles around a node: the share of a uniform traction that linear triangles give it.
    Eigen::VectorXd area = Eigen::VectorXd::Zero(rest.node_count);
    const auto boundary = meshing::boundary_surface(model.mesh);
    for (const auto& triangle : boundary.surface.triangles.colwise()) {
        const Eigen::Vector3d a = boundary.surface.nodes.col(triangle[0]), b = boundary.surface.nodes.col(triangle[1]),
                              c = boundary.surface.nodes.col(triangle[2]);
        if (std::min({a.x(), b.x(), c.x()}) < 40 - 1e-9) continue;
        for (const int corner : triangle)
            area[boundary.node_of[static_cast<std::size_t>(corner)]] += (b - a).cross(c - a).norm() / 6;
    }
    for (int node = 0; node < rest.node_count; ++node) {
        if (area[node] == 0) continue;
        Eigen::Matrix3d k = Eigen::Matrix3d::Zero();
        k(0, 0) = bar * area[node] / 100;
        conditions.springs.push_back({node, k, {target, 0, 0}});
    }
    const auto nodal = nodal_conditions(conditions, rest.node_count);
    const RestStiffness stiffness(rest, nodal);
    const auto engine = make_cpu_engine(rest, Scalar::Float64);
    const auto found = equilibrium(*engine, stiffness, nodal, {.tolerance_mm = 1e-7});
    for (const Spring& spring : conditions.springs)
        EXPECT_NEAR(found.displacement(0, spring.node), target / 2, 1e-3 * target);
}

TEST(Equilibrium, SameBitsForOneThreadAndMany) {
    const SeedCube cube(Element::AveragedPressureT4);
    const RestStiffness stiffness(cube.rest, cube.conditions);
    const auto solve = [&](std::size_t threads) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        const auto engine = make_cpu_engine(cube.rest, Scalar::Float32);
        return equilibrium(*engine, stiffness, cube.conditions, {.tolerance_mm = 0.01}).displacement;
    };
    EXPECT_EQ(solve(1), solve(2));
}

TEST(Equilibrium, AnUnreachableToleranceIsRefused) {
    const SeedCube cube(Element::T4, 4);
    const RestStiffness stiffness(cube.rest, cube.conditions);
    const auto engine = make_cpu_engine(cube.rest, Scalar::Float32);
    EXPECT_THROW(equilibrium(*engine, stiffness, cube.conditions, {.tolerance_mm = 1e-12, .max_steps = 500}),
                 SolverFailure);
}

TEST(Equilibrium, StopsWhenAsked) {
    struct Impatient : Observer {
        bool cancel_requested() override { return true; }
    } impatient;
    const SeedCube cube(Element::T4, 4);
    const RestStiffness stiffness(cube.rest, cube.conditions);
    const auto engine = make_cpu_engine(cube.rest, Scalar::Float32);
    EXPECT_THROW(equilibrium(*engine, stiffness, cube.conditions, {.tolerance_mm = 1e-4}, nullptr, impatient),
                 Cancelled);
}

}  // namespace
}  // namespace tissuewarp::tled
