/// Systems of the tangent at one state, prepared by the factor of another, against that state's own factor.

#include "tled/stiffness/tangent_factor.hpp"

#include "meshing/primitives.hpp"
#include "tled/model.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace tissuewarp::tled {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

struct Column {
    RestState rest;
    NodalConditions conditions;
    Matrix3Xd aside;  // a force on the top, mN
};

/// 20 × 20 × 100 mm on a bonded base, with springs on its side.
Column column(Element element) {
    Model model;
    model.mesh = meshing::box_mesh({20.0, 20.0, 100.0}, {2, 2, 10}, 0.1, 3);
    model.materials[1] = neo_hookean_iso(3.0, 0.47);
    model.element = element;
    Column made{rest_state(model), {}, {}};
    Conditions conditions;
    made.aside.setZero(3, model.mesh.node_count());
    for (int n = 0; n < model.mesh.node_count(); ++n) {
        const Vector3d X = model.mesh.nodes.col(n);
        if (X.z() < 1e-9) conditions.prescribed.push_back({n, {true, true, true}, Vector3d::Zero()});
        if (X.x() < 1e-9 && X.z() > 50)
            conditions.springs.push_back({n, 1e-3 * Eigen::Matrix3d::Identity(), Vector3d::Zero()});
        if (X.z() > 100 - 1e-9) made.aside(0, n) = 1;
    }
    made.conditions = nodal_conditions(conditions, made.rest);
    return made;
}

/// Its rest drawn out or pressed along z, with the sides free to follow.
Matrix3Xd stretched(const RestState& rest, double stretch) {
    const double across = 1 / std::sqrt(stretch);
    return Vector3d(across - 1, across - 1, stretch - 1).asDiagonal() * rest.position;
}

TEST(TangentFactor, OfOneStatePreparesAnother) {
    for (const Element element : {Element::T4, Element::AveragedPressureT4}) {
        const Column made = column(element);
        const Matrix3Xd there = stretched(made.rest, 1.01);
        detail::TangentFactor at_rest(made.rest, made.conditions.constrained),
            own(made.rest, made.conditions.constrained);
        ASSERT_TRUE(at_rest.factorise(made.conditions, stretched(made.rest, 1.0)));
        ASSERT_TRUE(own.factorise(made.conditions, there));
        const std::optional<Matrix3Xd> found = at_rest.solve_at(made.conditions, there, made.aside).x;
        ASSERT_TRUE(found);
        const Matrix3Xd expected = own.solve(made.aside);
        EXPECT_LT((*found - expected).norm(), 0.05 * expected.norm());
        EXPECT_GT((at_rest.solve(made.aside) - expected).norm(), 0.02 * expected.norm()) << "its own answer is another";
    }
}

TEST(TangentFactor, OfStableTissuePreparesTissueThatBuckles) {
    const Column made = column(Element::T4);
    const Matrix3Xd there = stretched(made.rest, 0.7);
    detail::TangentFactor tangent(made.rest, made.conditions.constrained);
    EXPECT_FALSE(tangent.solve_at(made.conditions, there, made.aside).x) << "nothing is factorised";
    ASSERT_TRUE(tangent.factorise(made.conditions, stretched(made.rest, 1.0)));
    EXPECT_TRUE(tangent.stable());
    const auto prepared = tangent.solve_at(made.conditions, there, made.aside);
    EXPECT_FALSE(prepared.positive);
    ASSERT_TRUE(prepared.x);
    const Matrix3Xd along = detail::tangent_product(made.rest, made.conditions, there)(prepared.falling);
    EXPECT_LT(prepared.falling.cwiseProduct(along).sum(), 0);

    ASSERT_TRUE(tangent.factorise(made.conditions, there));
    EXPECT_FALSE(tangent.stable());
    const Matrix3Xd of_positive_part = tangent.solve(made.aside);
    EXPECT_LT((*prepared.x - of_positive_part).norm(), 0.1 * of_positive_part.norm());
    ASSERT_TRUE(tangent.factorise_positive_part(made.conditions, there));
    EXPECT_TRUE(tangent.solve(made.aside).isApprox(of_positive_part, 1e-12));
}

}  // namespace
}  // namespace tissuewarp::tled
