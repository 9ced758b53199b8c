/// Increments that turn by finite angles, against rotations and stretches that are known.

#include "tled/statics/finite_rotations.hpp"

#include "meshing/primitives.hpp"
#include "tled/model.hpp"
#include "tled/model/kinematics.hpp"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

namespace tissuewarp::tled {
namespace {

using detail::element_jacobians;
using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;

RestState rod() {
    Model model;
    model.mesh = meshing::box_mesh({100.0, 10.0, 10.0}, {20, 2, 2}, 0.1, 3);
    model.materials[1] = neo_hookean_lnj(3.0, 0.3);
    return rest_state(model);
}

NodalConditions held_at_the_end(const RestState& rest) {
    Conditions conditions;
    for (int n = 0; n < rest.node_count; ++n)
        if (rest.position(0, n) < 1e-9) conditions.prescribed.push_back({n, {true, true, true}, Vector3d::Zero()});
    return nodal_conditions(conditions, rest);
}

/// The increment of a spin and a stretch of the whole in space, from X + u.
Matrix3Xd increment(const RestState& rest, const Matrix3Xd& u, const Matrix3d& gradient) {
    return gradient * (rest.position + u);
}

Matrix3d spin(const Vector3d& axis) {
    Matrix3d cross;
    cross << 0, -axis.z(), axis.y(), axis.z(), 0, -axis.x(), -axis.y(), axis.x(), 0;
    return cross;
}

TEST(FiniteRotations, TurnWhatIsFreeByTheWholeAngle) {
    const RestState rest = rod();
    const detail::FiniteRotations rotations(rest, nodal_conditions({}, rest));
    const Vector3d turn(0.3, -0.5, 1.2);
    const Matrix3d stretch = Vector3d(1.1, 0.95, 1.0).asDiagonal();
    const Matrix3Xd u = (stretch - Matrix3d::Identity()) * rest.position;
    const Matrix3Xd moved = rotations.moved(u, increment(rest, u, spin(turn)));
    const Matrix3d expected = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix() * stretch;
    const Matrix3Xd place = rest.position + moved;
    for (int n = 1; n < rest.node_count; ++n)  // but for a shift, which least squares leave to the attachment
        EXPECT_LT((place.col(n) - place.col(0) - expected * (rest.position.col(n) - rest.position.col(0))).norm(),
                  1e-3);
}

TEST(FiniteRotations, LeaveWhatOnlyStretchesAndSmallIncrementsAsTheyAre) {
    const RestState rest = rod();
    const detail::FiniteRotations rotations(rest, held_at_the_end(rest));
    const Matrix3Xd zero = Matrix3Xd::Zero(3, rest.node_count);
    const Matrix3Xd drawn = Vector3d(0.3, 0, 0).asDiagonal() * rest.position;
    EXPECT_LT((rotations.moved(zero, drawn) - drawn).cwiseAbs().maxCoeff(), 1e-9);
    Matrix3Xd bent = zero;
    for (int n = 0; n < rest.node_count; ++n) {
        const double x = rest.position(0, n), z = rest.position(2, n) - 5;
        bent.col(n) = 1e-5 * Vector3d(-x * z, 0, 0.5 * x * x);
    }
    EXPECT_LT((rotations.moved(zero, bent) - bent).cwiseAbs().maxCoeff(), 1e-3 * bent.cwiseAbs().maxCoeff());
}

TEST(FiniteRotations, LeaveAxesAlongWhichNothingIsFree) {
    const RestState rest = rod();
    Conditions conditions;
    for (int n = 0; n < rest.node_count; ++n)
        conditions.prescribed.push_back({n, {false, true, false}, Vector3d::Zero()});
    const detail::FiniteRotations rotations(rest, nodal_conditions(conditions, rest));
    const Matrix3Xd zero = Matrix3Xd::Zero(3, rest.node_count);
    const Matrix3Xd turned = rotations.moved(zero, spin({0, 0.7, 0}) * rest.position);
    EXPECT_EQ(turned.row(1), zero.row(1));
    const Matrix3d expected = Eigen::AngleAxisd(0.7, Vector3d::UnitY()).toRotationMatrix();
    const Matrix3Xd place = rest.position + turned;
    EXPECT_LT((place.col(rest.node_count - 1) - place.col(0) -
               expected * (rest.position.col(rest.node_count - 1) - rest.position.col(0)))
                  .norm(),
              1e-3);
}

// A rod that is bent into a circle by an increment that is linear in the angle keeps its length.
TEST(FiniteRotations, BendARodWithoutDrawingItOut) {
    const RestState rest = rod();
    const detail::FiniteRotations rotations(rest, held_at_the_end(rest));
    const double curvature = 1.5 / 100;  // a slope of 1.5 at the free end
    Matrix3Xd bend(3, rest.node_count);
    for (int n = 0; n < rest.node_count; ++n) {
        const double x = rest.position(0, n), z = rest.position(2, n) - 5;
        bend.col(n) = curvature * Vector3d(-x * z, 0, 0.5 * x * x);
    }
    const Matrix3Xd moved = rotations.moved(Matrix3Xd::Zero(3, rest.node_count), bend);
    const Matrix3Xd place = rest.position + moved;
    for (int n = 0; n < rest.node_count; ++n) {
        if ((rest.position.col(n) - Vector3d(100, 5, 5)).norm() > 1e-9) continue;
        const Vector3d circle(std::sin(1.5) / curvature, 5, 5 + (1 - std::cos(1.5)) / curvature);
        EXPECT_LT((place.col(n) - circle).norm(), 1.5);
        EXPECT_GT((rest.position.col(n) + bend.col(n) - circle).norm(), 30) << "straight on";
    }
}

// Bent as it is but for one end, which is to stay a little elsewhere, and for a node that was carried beyond its
// neighbours.
TEST(FiniteRotations, MendWhatAnotherDisplacementTurnsInsideOut) {
    const RestState rest = rod();
    NodalConditions conditions = held_at_the_end(rest);
    const detail::FiniteRotations rotations(rest, conditions);
    Matrix3Xd bent(3, rest.node_count);
    for (int n = 0; n < rest.node_count; ++n) {
        const double angle = 0.01 * rest.position(0, n), across = rest.position(2, n) - 5;
        bent.col(n) =
            Vector3d((100 - across) * std::sin(angle), rest.position(1, n), 105 - (100 - across) * std::cos(angle)) -
            rest.position.col(n);
    }
    Matrix3Xd carried = bent;
    carried.row(1).array() += 4;
    int beyond = 0;
    while ((rest.position.col(beyond) - Vector3d(50, 5, 5)).norm() > 2) ++beyond;
    carried.col(beyond) += Vector3d(0, 7, 0);
    ASSERT_LT(element_jacobians(rest, conditions.constrained.select(conditions.imposed, carried)).minCoeff(), 0);
    const Matrix3Xd mended = rotations.like(carried, conditions);
    EXPECT_GT(element_jacobians(rest, mended).minCoeff(), 0);
    EXPECT_EQ(conditions.constrained.select(mended, 0.0), conditions.constrained.select(conditions.imposed, 0.0));
    EXPECT_LT((mended - bent).colwise().norm().maxCoeff(), 8);
    EXPECT_LT((rotations.like(bent, conditions) - bent).cwiseAbs().maxCoeff(), 1e-6) << "nothing is to be mended";
}

}  // namespace
}  // namespace tissuewarp::tled
