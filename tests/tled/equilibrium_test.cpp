/// Dynamic relaxation on every engine against Newton's method, on the cube of Taylor, Cheng and Ourselin (2007).
#include "tled/equilibrium.hpp"
#include "meshing/primitives.hpp"
#include "tled/reference.hpp"

#include <gmock/gmock.h>
#include <tbb/global_control.h>
#include <Eigen/Geometry>

#include <cmath>

namespace tissuewarp::tled {
namespace {

using Eigen::Matrix3Xd;

double largest_difference(const Matrix3Xd& a, const Matrix3Xd& b) {
    return std::sqrt((a - b).colwise().squaredNorm().maxCoeff());
}

/// Cube of 100 mm, λ = 49.329 kPa, μ = 1.007 kPa, ends bonded, one pulled by 20 mm.
struct SeedCube {
    Model model;
    RestState rest;
    NodalConditions conditions;

    explicit SeedCube(Element element, int cells = 8) {
        model.mesh = meshing::box_mesh({100, 100, 100}, {cells, cells, cells});
        model.materials[1] = NeoHookeanLnJ{1.007, 49.329};
        model.element = element;
        rest = rest_state(model);
        Conditions bonded;
        for (int node = 0; node < model.mesh.node_count(); ++node) {
            const double z = model.mesh.nodes(2, node);
            if (z < 1e-9) bonded.prescribed.push_back({node, {true, true, true}, {0, 0, 0}});
            if (z > 100 - 1e-9) bonded.prescribed.push_back({node, {true, true, true}, {0, 0, 20}});
        }
        conditions = nodal_conditions(bonded, rest.node_count);
    }
};

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
