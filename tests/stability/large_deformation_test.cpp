// Stretches from 0.1 to 3, a half turn, a right angle, and loads that come at once.

#include "tests/stability/hard_cases.hpp"

#include <Eigen/Geometry>

#include <numbers>

namespace tissuewarp::stability {
namespace {

using LargeDeformation = OnEveryEngine;
INSTANTIATE_TEST_SUITE_P(All, LargeDeformation, every_engine, engine_name);

/// Lateral stretch b of a free bar stretched by l under the lnJ law: μ (b² − 1) + λ ln(l b²) = 0.
double lateral_stretch(double l, double mu, double lambda) {
    double low = 0.01, high = 10;
    for (int i = 0; i < 100; ++i) {
        const double b = 0.5 * (low + high);
        (mu * (b * b - 1) + lambda * std::log(l * b * b) > 0 ? high : low) = b;
    }
    return low;
}

// Homogeneous states in closed form. A failure looks like: elements that invert on the way to 0.1, a lateral stretch
// that is not the closed form's, or a refusal although the state exists. Tolerance 0.01 mm of 20 mm.
TEST_P(LargeDeformation, AFreeBarStretchesFromATenthToThreeTimesItsLength) {
    const tled::NeoHookeanLnJ law = tled::neo_hookean_lnj(3.0, 0.3);
    const tled::Model model = box({20, 20, 20}, {3, 3, 3}, law, tled::Element::T4);
    const tled::RestState rest = tled::rest_state(model);
    for (const double stretch : {0.1, 0.3, 0.7, 1.5, 3.0}) {
        tled::Conditions rollers;
        for (int node = 0; node < rest.node_count; ++node) {
            const Vector3d X = model.mesh.nodes.col(node);
            const bool top = X.z() > 20 - 1e-9;
            const std::array<bool, 3> on{X.x() == 0, X.y() == 0, X.z() == 0 || top};
            if (on[0] || on[1] || on[2]) rollers.prescribed.push_back({node, on, {0, 0, top ? 20 * (stretch - 1) : 0}});
        }
        const tled::NodalConditions conditions = tled::nodal_conditions(rollers, rest.node_count);
        const double lateral = lateral_stretch(stretch, law.shear_modulus, law.lame_lambda);
        const Matrix3Xd expected = Vector3d(lateral - 1, lateral - 1, stretch - 1).asDiagonal() * model.mesh.nodes;
        EXPECT_LT(distance(solved_in_parts(GetParam(), rest, conditions, 0.002, 4), expected), 0.01) << stretch;
    }
}

tled::Model bar() {
    tled::Model model = box({10, 10, 60}, {3, 3, 18}, tled::neo_hookean_lnj(10.0, 0.45));
    return model;
}

/// Top turned about z by an angle around the bar's axis.
tled::NodalConditions twisted(const tled::Model& model, double angle) {
    const Matrix3d R = Eigen::AngleAxisd(angle, Vector3d::UnitZ()).toRotationMatrix();
    const Vector3d axis(5, 5, 0);
    return held(model, [&](const Vector3d& X) -> std::optional<Vector3d> {
        if (X.z() == 0) return Vector3d::Zero();
        if (X.z() > 60 - 1e-9) return (R - Matrix3d::Identity()) * (X - axis);
        return std::nullopt;
    });
}

/// Equilibria along a path of conditions, each from the last; `solve` takes conditions and a start.
template <class At, class Solve>
Matrix3Xd along(const At& at, int steps, int nodes, const Solve& solve) {
    Matrix3Xd u = Matrix3Xd::Zero(3, nodes);
    for (int step = 1; step <= steps; ++step) u = solve(at(static_cast<double>(step) / steps), u);
    return u;
}

// The middle must turn by half the angle: by symmetry exactly. A failure looks like: elements that invert at the ends,
// a bar that buckles or unwinds, a middle that turned by another angle. Tolerance 0.1 mm.
TEST_P(LargeDeformation, ABarTwistsByHalfATurn) {
    const tled::Model model = bar();
    const tled::RestState rest = tled::rest_state(model);
    const Matrix3Xd u = along([&](double part) { return twisted(model, part * std::numbers::pi); }, 12, rest.node_count,
                              [&](const tled::NodalConditions& conditions, const Matrix3Xd& start) {
                                  return solved(GetParam(), rest, conditions, 0.02, &start);
                              });
    EXPECT_GT(tled::jacobians(rest, u).minCoeff(), 0.2);
    for (int node = 0; node < rest.node_count; ++node) {
        const Vector3d X = model.mesh.nodes.col(node);
        if (std::abs(X.z() - 30) > 1e-9 || (X.head<2>() - Eigen::Vector2d(5, 5)).norm() > 1e-9) continue;
        EXPECT_LT(u.col(node).norm(), 0.3) << "the axis stays";
    }
    // The residual at the answer, in float64, whatever engine found it: below a thousandth of the ends' forces.
    Matrix3Xd force = tled::internal_force(rest, u);
    const double reaction = force.colwise().norm().maxCoeff();
    const auto constrained = twisted(model, std::numbers::pi).constrained;
    force = constrained.select(Matrix3Xd::Zero(3, rest.node_count), force).eval();
    EXPECT_LT(force.colwise().norm().maxCoeff(), 0.01 * reaction);
}

// The free end follows the imposed arc. A failure looks like: inversion on the inner side, no convergence.
TEST_P(LargeDeformation, ABarBendsToARightAngle) {
    const tled::Model model = bar();
    const tled::RestState rest = tled::rest_state(model);
    const auto bent = [&](double part) {
        const double angle = part * std::numbers::pi / 2, radius = 60 / angle;
        const Matrix3d R = Eigen::AngleAxisd(angle, Vector3d::UnitY()).toRotationMatrix();
        // The axis bends into an arc of its length: its end goes to radius (1 − cos, 0, sin).
        const Vector3d end(radius * (1 - std::cos(angle)), 0, radius * std::sin(angle));
        return held(model, [=](const Vector3d& X) -> std::optional<Vector3d> {
            if (X.z() == 0) return Vector3d::Zero();
            if (X.z() < 60 - 1e-9) return std::nullopt;
            const Vector3d arm = X - Vector3d(5, 5, 60);
            return Vector3d(Vector3d(5, 5, 0) + end + R * arm - X);
        });
    };
    const Matrix3Xd truth =
        along(bent, 6, rest.node_count, [&](const tled::NodalConditions& conditions, const Matrix3Xd& start) {
            return solved(Kind::CpuFloat64, rest, conditions, 0.001, &start);
        });
    const Matrix3Xd u =
        along(bent, 6, rest.node_count, [&](const tled::NodalConditions& conditions, const Matrix3Xd& start) {
            return solved(GetParam(), rest, conditions, 0.02, &start);
        });
    EXPECT_LT(distance(u, truth), 0.05);
    EXPECT_GT(tled::jacobians(rest, u).minCoeff(), 0.2);
    Eigen::Index middle = 0;
    (model.mesh.nodes.colwise() - Vector3d(5, 5, 30)).colwise().norm().minCoeff(&middle);
    // The arc's middle: radius 38.2 mm, 45°.
    const double radius = 120 / std::numbers::pi;
    const Vector3d arc(radius * (1 - std::sqrt(0.5)), 0, radius * std::sqrt(0.5) - 30);
    EXPECT_LT((u.col(middle) - arc).norm(), 2.5);
}

// A quarter of the height in one go and a force that presses as hard: no ramp. A failure looks like: torn nodes beside
// the plate, a restart loop, an answer that differs from the ramped one. Tolerance 0.05 mm of 10 mm.
TEST_P(LargeDeformation, LoadsMayComeAtOnce) {
    const tled::Model model = box({40, 40, 40}, {6, 6, 6}, tled::neo_hookean_lnj(3.0, 0.45));
    const tled::RestState rest = tled::rest_state(model);
    tled::NodalConditions conditions = between_plates(model, {0, 0, -10});
    for (int node = 0; node < rest.node_count; ++node)
        if (model.mesh.nodes(0, node) < 1e-9) conditions.external_force(0, node) = 10;  // mN
    const Matrix3Xd ramped = by_newton(rest, conditions, 8);
    EXPECT_LT(distance(solved(GetParam(), rest, conditions, 0.02), ramped), 0.05);
}

// Four fifths pressed in one go cannot be: either the answer of the ramp, or a refusal that says so.
TEST_P(LargeDeformation, TooMuchAtOnceIsAnsweredOrRefusedNeverInvented) {
    const tled::Model model = box({40, 40, 40}, {5, 5, 5}, tled::neo_hookean_lnj(3.0, 0.45));
    const tled::RestState rest = tled::rest_state(model);
    const tled::NodalConditions conditions = between_plates(model, {0, 0, -32});
    const auto engine = make_engine(GetParam(), rest);
    const tled::RestStiffness stiffness(rest, conditions);
    try {
        const auto found = tled::equilibrium(*engine, stiffness, conditions, {.tolerance_mm = 0.05});
        EXPECT_GT(tled::jacobians(rest, found.displacement).minCoeff(), 0.0);
        Matrix3Xd force = tled::internal_force(rest, found.displacement);
        const double reaction = force.colwise().norm().maxCoeff();
        force = conditions.constrained.select(Matrix3Xd::Zero(3, rest.node_count), force).eval();
        EXPECT_LT(force.colwise().norm().maxCoeff(), 0.05 * reaction);
    } catch (const SolverFailure& refusal) {
        EXPECT_NE(std::string(refusal.what()).find("load"), std::string::npos) << refusal.what();
    }
    EXPECT_TRUE(engine->displacement().allFinite());
}

}  // namespace
}  // namespace tissuewarp::stability
