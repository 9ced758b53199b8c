// Inverted elements: the law that admits them finds back, the others refuse.

#include "core/errors.hpp"
#include "tests/stability/hard_cases.hpp"

namespace tissuewarp::stability {
namespace {

using Inversion = OnEveryEngine;
INSTANTIATE_TEST_SUITE_P(All, Inversion, every_engine, engine_name);

/// Every free node thrown by up to `size` mm.
Matrix3Xd thrown(const tled::NodalConditions& conditions, double size) {
    Matrix3Xd u(3, conditions.constrained.cols());
    std::uint32_t state = 7;
    for (double& x : u.reshaped()) {
        state = 1664525u * state + 1013904223u;
        x = size * (state / 2147483648.0 - 1.0);
    }
    return conditions.constrained.select(conditions.imposed, u);
}

// A third of the elements start inside out. A failure looks like: elements that stay inverted, a NaN, an answer that is
// not the one from rest. Tolerance 0.05 mm.
TEST_P(Inversion, ARandomStartRecoversWithTheStableLaw) {
    for (const tled::Element element : {tled::Element::T4, tled::Element::AveragedPressureT4}) {
        const tled::Model model = box({30, 30, 30}, {4, 4, 4}, tled::neo_hookean_stable(3.0, 0.45), element);
        const tled::RestState rest = tled::rest_state(model);
        const tled::NodalConditions conditions = between_plates(model, {0, 0, -3});
        const Matrix3Xd truth = by_newton(rest, conditions);
        const Matrix3Xd start = thrown(conditions, 6);
        const auto inverted = (tled::jacobians(rest, start).array() <= 0).count();
        ASSERT_GT(inverted, rest.element_count() / 10);
        const Matrix3Xd u = solved(GetParam(), rest, conditions, 0.02, &start);
        EXPECT_LT(distance(u, truth), 0.05) << "element " << static_cast<int>(element);
        EXPECT_GT(tled::jacobians(rest, u).minCoeff(), 0.5);
    }
}

// Another law has no force there: it must say so and name the place. A failure looks like: an answer, or a NaN.
TEST_P(Inversion, ARandomStartIsRefusedByLawsThatKnowNoInvertedState) {
    const tled::Model model = box({30, 30, 30}, {4, 4, 4}, tled::neo_hookean_lnj(3.0, 0.45));
    const tled::RestState rest = tled::rest_state(model);
    const tled::NodalConditions conditions = between_plates(model, {0, 0, -3});
    const Matrix3Xd start = thrown(conditions, 6);
    const auto engine = make_engine(GetParam(), rest);
    const tled::RestStiffness stiffness(rest, conditions);
    EXPECT_THROW(tled::equilibrium(*engine, stiffness, conditions, {.tolerance_mm = 0.02}, &start), SolverFailure);
}

}  // namespace
}  // namespace tissuewarp::stability
