// The problems of data/reference on small meshes: the finest of four agrees within the reference's uncertainty plus
// the mesh error that the four show. The whole set on finer meshes: benchmarks/verification_table.

#include "tests/verification/problems.hpp"
#include "tests/verification/study.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace tissuewarp::verification {
namespace {

void expect_met(const Problem& problem, const Study& study) {
    for (const Comparison& c : study.comparisons) {
        EXPECT_TRUE(c.met()) << problem.name << ", " << c.quantity << ": off by " << c.off << " " << c.unit
                             << ", reference known to " << c.uncertain << ", mesh error " << c.mesh_error();
    }
}

double relative_off(const Quantity& quantity, const Solution& solution) {
    return std::abs(quantity.measure(solution)[0] / quantity.reference[0] - 1.0);
}

// The deflection of the tip, mm, on 16 × 16 cells: T4 locks as ν → ½, the others do not.
TEST(CookVerification, OnlyPlainLinearTetrahedraLock) {
    for (const double nu : {0.3, 0.49, 0.4999}) {
        const Problem problem = cook_plane_strain(Law::Iso, nu);
        const Quantity& tip = problem.quantities[1];
        const auto off = [&](Elements elements, int level) {
            return relative_off(tip, solve(problem, elements, level));
        };
        if (nu > 0.4) {
            EXPECT_GT(off(Elements::T4, 16), nu > 0.499 ? 0.5 : 0.2) << nu;
        }
        EXPECT_LT(off(Elements::AveragedPressure, 16), 0.1) << nu;
        EXPECT_LT(off(Elements::QuadraticMixed, 8), 0.02) << nu;
    }
}

// What highest_order() says: at ν = 0.3 halving the cells divides the error of the tip by nearly 4 with averages of J,
// by more than 8 with the pressure in the points.
TEST(CookVerification, LumpedAveragesOfJErrInSecondOrder) {
    const Problem problem = cook_plane_strain(Law::Iso, 0.3);
    const Quantity& tip = problem.quantities[1];
    const auto fall = [&](Elements elements) {
        return relative_off(tip, solve(problem, elements, 8)) / relative_off(tip, solve(problem, elements, 16));
    };
    EXPECT_NEAR(fall(Elements::QuadraticMixed), 3.5, 0.5);
    EXPECT_GT(fall(Elements::Quadratic), 8.0);
}

TEST(CookVerification, PlaneStrain) {
    const Problem problem = cook_plane_strain(Law::LnJ, 0.499);
    expect_met(problem, study(problem, Elements::AveragedPressure, {6, 12, 18, 24}));
}

// Why a corner of the reference can be missed (docs/lab/verification.md): on finer meshes T10 keeps the tip of the
// reference, but its corner lies below by more than twice the uncertainty, as the reference's own meshes do the finer
// they are.
TEST(CookVerification, TheReferencesCornerIsNotConverged) {
    const Problem problem = cook_plane_strain(Law::Iso, 0.3);
    const Study found = study(problem, Elements::Quadratic, {8, 12, 16, 24});
    const Comparison &tip = found.comparisons[1], &corner = found.comparisons[2];
    EXPECT_LT(std::abs(tip.extrapolated - tip.reference[0]), tip.uncertain + tip.limit_error);
    EXPECT_LT(corner.extrapolated + corner.limit_error, corner.reference[0] - 2.0 * corner.uncertain);
    EXPECT_LT(corner.limit_error, 0.1 * corner.uncertain);
}

TEST(CookVerification, ThreeDimensions) {
    const Problem problem = *cook_3d(Law::Iso, 0.499);
    expect_met(problem, study(problem, Elements::AveragedPressure, {4, 8, 12, 16}));
}

TEST(BarVerification, Twist) {
    const Problem problem = bar_twist(Law::LnJ);
    const Solution found = solve(problem, Elements::Quadratic, 3);
    for (const int q : {0, 2}) EXPECT_LT(relative_off(problem.quantities[static_cast<std::size_t>(q)], found), 0.03);
}

TEST(BarVerification, Cantilever) {
    const Problem problem = cantilever(Law::Iso);
    expect_met(problem, study(problem, Elements::AveragedPressure, {2, 4, 6, 8}));
}

TEST(EllipsoidVerification, Plain) {
    const Problem problem = ellipsoid_plain(Law::LnJ);
    expect_met(problem, study(problem, Elements::AveragedPressure, {2, 4, 6, 8}));
}

TEST(BreastVerification, GravityBothWays) {
    for (const Gravity gravity : {Gravity::Prone, Gravity::Supine}) {
        const Problem problem = breast(Law::Iso, gravity);
        expect_met(problem, study(problem, Elements::AveragedPressure, {3, 6, 9, 12}));
    }
}

TEST(ContactVerification, BlockBetweenPlanesMeetsTheClosedForm) {
    for (const Law law : {Law::Iso, Law::LnJ}) {
        for (const int step : {0, 1, 2, 3}) {
            const Problem problem = block_contact(law, step);
            const Solution found = solve(problem, Elements::AveragedPressure, 2);
            for (const Quantity& q : problem.quantities) {
                EXPECT_NEAR(q.measure(found)[0], q.reference[0], 1e-6 * std::abs(q.reference[0])) << q.name;
            }
        }
    }
}

TEST(ContactVerification, HalfBall) {
    const Problem problem = half_ball_contact(Law::Iso, 7);
    const Solution found = solve(problem, Elements::AveragedPressure, 7);
    EXPECT_LT(relative_off(problem.quantities[0], found), 0.05);
    EXPECT_NEAR(problem.quantities[1].measure(found)[0], problem.quantities[1].reference[0], 0.03);  // mm
}

// A deformed surface of known shape, 50.5 mm at its widest: the largest radius of a node would be up to 7 µm less.
TEST(ContactVerification, BulgeIsMeasuredBetweenNodes) {
    const Problem problem = half_ball_contact(Law::Iso, 7);
    Solution shaped;
    shaped.mesh = problem.mesh(6);
    shaped.displacement = Eigen::Matrix3Xd::Zero(3, shaped.mesh.node_count());
    double largest_of_nodes = 0.0;
    for (int i = 0; i < shaped.mesh.node_count(); ++i) {
        const Eigen::Vector3d X = shaped.mesh.nodes.col(i);
        if (X.norm() < 50.0 - 1e-6 || X.head<2>().norm() < 1e-6) continue;
        const double radius = 50.5 - 0.002 * (X[2] - 17.0) * (X[2] - 17.0);
        shaped.displacement.col(i).head<2>() = (radius / X.head<2>().norm() - 1.0) * X.head<2>();
        largest_of_nodes = std::max(largest_of_nodes, radius);
    }
    EXPECT_LT(largest_of_nodes, 50.499);
    EXPECT_NEAR(problem.quantities[1].measure(shaped)[0], 50.5, 1e-9);
}

}  // namespace
}  // namespace tissuewarp::verification
