// The cube of the seed method against the reference solutions of data/reference: the finest mesh agrees within the
// reference's uncertainty plus the mesh error that three meshes show.

#include "tests/verification/problems.hpp"
#include "tests/verification/study.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace tissuewarp::verification {
namespace {

void expect_all_met(const Problem& problem, const Study& study) {
    for (const Comparison& c : study.comparisons) {
        EXPECT_TRUE(c.met()) << problem.name << ", " << c.quantity << ": off by " << c.off << " " << c.unit
                             << ", reference known to " << c.uncertain << ", mesh error " << c.mesh_error;
    }
}

TEST(Richardson, RecoversLimitAndOrder) {
    const auto value = [](double h) { return 7.0 + 0.3 * std::pow(h, 1.7); };
    const double a = value(1.0 / 8), b = value(1.0 / 12), c = value(1.0 / 18);
    const Extrapolation found = richardson(a, b, c, 1.5);
    EXPECT_NEAR(found.value, 7.0, 1e-12);
    EXPECT_NEAR(found.order, 1.7, 1e-10);
    EXPECT_NEAR(mesh_error(b - a, c - b, 1.5, 2.0), c - 7.0, 1e-12);
    EXPECT_TRUE(std::isnan(richardson(1.0, 2.0, 4.0, 1.5).order));
    EXPECT_DOUBLE_EQ(mesh_error(0.1, -0.2, 1.5, 2.0), 0.4);
    EXPECT_DOUBLE_EQ(mesh_error(64.0, 1.0, 2.0, 2.0), 1.0 / 3.0);  // no better than second order is believed
}

// Oberkampf & Roy 2010, table 8.1: a miss of the order by more than a tenth, and no order at all, cost a factor of 3.
TEST(Richardson, SafetyFactorTrustsOnlyTheElementsOwnOrder) {
    EXPECT_EQ(safety_factor(2.0, 2.0), 1.25);
    EXPECT_EQ(safety_factor(1.85, 2.0), 1.25);
    EXPECT_EQ(safety_factor(1.7, 2.0), 3.0);
    EXPECT_EQ(safety_factor(2.5, 4.0), 3.0);
    EXPECT_EQ(safety_factor(std::nan(""), 2.0), 3.0);
    EXPECT_EQ(safety_factor(-1.0, 2.0), 3.0);
}

// The weaker bar stands beside the strict one and never replaces it.
TEST(Richardson, ComparisonHoldsBothBars) {
    const Quantity quantity{"length", "mm", Eigen::VectorXd::Constant(1, 10.0), Eigen::VectorXd::Constant(1, 0.1), {}};
    const auto value = [](double v) { return Eigen::VectorXd(Eigen::VectorXd::Constant(1, v)); };
    const Comparison c = compare(quantity, {value(14.0), value(12.0), value(11.0)}, 2.0, 2.0);  // order 1: error 1
    EXPECT_DOUBLE_EQ(c.mesh_error, 1.0);
    EXPECT_TRUE(c.met());
    const Comparison farther = compare(quantity, {value(15.0), value(13.0), value(12.0)}, 2.0, 2.0);
    EXPECT_NEAR(farther.excess(), 0.9, 1e-12);
    EXPECT_FALSE(farther.met());
    EXPECT_TRUE(farther.met_within_index());
    EXPECT_FALSE(compare(quantity, {value(17.0), value(15.0), value(14.0)}, 2.0, 2.0).met_within_index());
}

// Misses of plain tetrahedra are forgiven by Poisson's ratio alone: 0.45 is not beyond the rule, 0.49 is.
TEST(Richardson, LockingIsExpectedByPoissonsRatio) {
    EXPECT_FALSE(expected_to_lock(cook_plane_strain(Law::Iso, 0.45), Elements::T4));
    EXPECT_TRUE(expected_to_lock(cook_plane_strain(Law::Iso, 0.49), Elements::T4));
    EXPECT_FALSE(expected_to_lock(cook_plane_strain(Law::Iso, 0.49), Elements::Hexahedra));
}

// 6085.2 and 6118.4 mN, known to 0.02.
TEST(CubeVerification, StretchAveragedPressure) {
    for (const Law law : {Law::Iso, Law::LnJ}) {
        const Problem problem = cube_stretch(law);
        const Study found = study(problem, Elements::AveragedPressure, {4, 6, 9});
        expect_all_met(problem, found);
        EXPECT_LT(std::abs(found.comparisons[0].off), 0.006 * found.comparisons[0].reference[0]);
        EXPECT_NEAR(found.comparisons[0].order, 2.0, 0.15);
    }
}

// Twice as close as averaged pressure on the same nodes; a wrong order of the corners would turn elements inside out.
TEST(CubeVerification, StretchHexahedra) {
    for (const Law law : {Law::Iso, Law::LnJ}) {
        const Problem problem = cube_stretch(law);
        const Study found = study(problem, Elements::Hexahedra, {4, 6, 9});
        expect_all_met(problem, found);
        EXPECT_LT(std::abs(found.comparisons[0].off), 0.003 * found.comparisons[0].reference[0]);
        EXPECT_NEAR(found.comparisons[0].order, 1.8, 0.15);
    }
}

// Within 0.1 % on 729 nodes, where the linear element is 0.5 % off on 1 000.
TEST(CubeVerification, StretchQuadraticMixed) {
    for (const Law law : {Law::Iso, Law::LnJ}) {
        const Problem problem = cube_stretch(law);
        const Solution found = solve(problem, Elements::QuadraticMixed, 4);
        const Quantity& force = problem.quantities[0];
        EXPECT_NEAR(force.measure(found)[0], force.reference[0], 0.001 * force.reference[0]);  // mN
    }
}

// Without averaging the force converges to the same value from much farther away: locking at ν = 0.49.
TEST(CubeVerification, StretchT4Locks) {
    const Study found = study(cube_stretch(Law::Iso), Elements::T4, {4, 6, 9});
    EXPECT_GT(found.comparisons[0].off, 0.02 * found.comparisons[0].reference[0]);
    EXPECT_NEAR(found.comparisons[0].extrapolated, found.comparisons[0].reference[0],
                0.01 * found.comparisons[0].reference[0]);
}

// −6414.3 ± 30.2 and −6391.3 ± 36.6 mN.
TEST(CubeVerification, MildCompressionAveragedPressure) {
    for (const Law law : {Law::Iso, Law::LnJ}) {
        const Problem problem = cube_mild_compression(law);
        expect_all_met(problem, study(problem, Elements::AveragedPressure, {4, 6, 9}));
    }
}

// −14.68 ± 0.59 and −14.61 ± 0.66 N: the edges fold.
TEST(CubeVerification, CompressionAveragedPressure) {
    for (const Law law : {Law::Iso, Law::LnJ}) {
        const Problem problem = cube_compression(law);
        expect_all_met(problem, study(problem, Elements::AveragedPressure, {4, 6, 9}));
    }
}

// 3812.0 ± 14.4 mN sideways.
TEST(CubeVerification, ShearAveragedPressure) {
    const Problem problem = cube_shear(Law::Iso);
    expect_all_met(problem, study(problem, Elements::AveragedPressure, {1, 2, 4}));
}

}  // namespace
}  // namespace tissuewarp::verification
