// What a solver left, in mm.

#include "tled/error/lifted_residual.hpp"

#include "core/errors.hpp"
#include "meshing/primitives.hpp"
#include "tled/equilibrium.hpp"
#include "tled/reference/newton.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace tissuewarp::tled {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

/// A box held below and drawn sideways by springs on its top.
struct Drawn {
    explicit Drawn(double pull_mm) {
        model.mesh = meshing::box_mesh({20.0, 20.0, 20.0}, {4, 4, 4}, 0.1, 3);
        model.materials[1] = neo_hookean_iso(3.0, 0.49);
        rest = rest_state(model);
        Conditions all;
        for (int i = 0; i < rest.node_count; ++i) {
            const double z = model.mesh.nodes(2, i);
            if (z < 1e-9) all.prescribed.push_back({i, {true, true, true}, Vector3d::Zero()});
            if (z > 20.0 - 1e-9) {
                all.springs.push_back({i, 2.0 * Eigen::Matrix3d::Identity(), Vector3d(pull_mm, 0.0, 0.0)});
            }
        }
        conditions = nodal_conditions(all, rest.node_count);
        solution = newton_equilibrium(rest, conditions, {.tolerance_mm = 1e-8}).displacement;
    }
    // Free displacements of a given size at the free nodes.
    [[nodiscard]] Matrix3Xd disturbance(double size_mm) const {
        Matrix3Xd d(3, rest.node_count);
        for (int i = 0; i < rest.node_count; ++i) {
            const Vector3d X = model.mesh.nodes.col(i);
            d.col(i) << std::sin(0.2 * X[1]), std::cos(0.1 * X[0]), std::sin(0.15 * X[2]);
        }
        return conditions.constrained.select(0.0, size_mm * d);
    }
    [[nodiscard]] Matrix3Xd lifted(const Matrix3Xd& u) const {
        return lifted_residual(rest, RestStiffness(rest, conditions), conditions, u);
    }

    Model model;
    RestState rest;
    NodalConditions conditions;
    Matrix3Xd solution;
};

TEST(LiftedResidual, VanishesInEquilibrium) {
    const Drawn box(5.0);
    EXPECT_GT(box.solution.cwiseAbs().maxCoeff(), 1.0);
    EXPECT_LT(box.lifted(box.solution).cwiseAbs().maxCoeff(), 1e-8);
}

// Near rest it is the missing displacement itself; a wrong sign would double it.
TEST(LiftedResidual, IsTheMissingDisplacement) {
    const Drawn box(0.0);
    const Matrix3Xd missing = box.disturbance(1e-4);
    EXPECT_LT((box.lifted(box.solution - missing) - missing).norm(), 0.01 * missing.norm());
}

// What a solver leaves under strain: within the bounds of docs/decisions/equilibrium.md.
TEST(LiftedResidual, IsOfTheSizeOfWhatASolverLeft) {
    const Drawn box(8.0);
    const auto engine = make_cpu_engine(box.rest, Scalar::Float64);
    const Matrix3Xd u =
        equilibrium(*engine, RestStiffness(box.rest, box.conditions), box.conditions, {.tolerance_mm = 0.1})
            .displacement;
    const double ratio = box.lifted(u).norm() / (box.solution - u).norm();
    EXPECT_GT(ratio, 0.2);
    EXPECT_LT(ratio, 3.4);
}

TEST(LiftedResidual, OfInvertedTissueIsRefused) {
    const Drawn box(1.0);
    EXPECT_THROW(static_cast<void>(box.lifted(-2.0 * box.model.mesh.nodes)), SolverFailure);
}

}  // namespace
}  // namespace tissuewarp::tled
