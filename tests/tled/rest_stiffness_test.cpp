#include "tled/stiffness/rest_stiffness.hpp"

#include "core/errors.hpp"
#include "meshing/primitives.hpp"
#include "tled/model/internal_force.hpp"
#include "tled/stiffness/tangent_stiffness.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>
#include <Eigen/SparseLU>

#include <cmath>
#include <random>

namespace tissuewarp::tled {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;

Matrix3Xd random_forces(int nodes) {
    std::mt19937 generator(3);
    Matrix3Xd result(3, nodes);
    for (double& value : result.reshaped()) value = static_cast<double>(generator()) / generator.max() - 0.5;
    return result;
}

class RestStiffnessTest : public testing::TestWithParam<Element> {
protected:
    RestStiffnessTest() {
        model.mesh = meshing::box_mesh({40.0, 30.0, 20.0}, {4, 3, 3}, 0.1, 5);
        model.materials[1] = neo_hookean_lnj(3.0, 0.49);
        model.element = GetParam();
        rest = rest_state(model);
    }

    // Bottom held: one node wholly, the others in z alone; springs on the top, with off-diagonal terms.
    [[nodiscard]] Conditions held_with_springs(double stiffness) const {
        Conditions conditions;
        for (int i = 0; i < model.mesh.node_count(); ++i) {
            const double z = model.mesh.nodes(2, i);
            if (z < 1e-9) conditions.prescribed.push_back({i, {i == 0, i == 0, true}, Vector3d::Zero()});
            if (z > 20.0 - 1e-9) {
                const Vector3d n = Vector3d(0.1 * (i % 5), 0.2, 1.0).normalized();
                conditions.springs.push_back({i, stiffness * (n * n.transpose() + 0.1 * Matrix3d::Identity()),
                                              Vector3d(0.3, -0.2, 0.01 * (i % 7))});
            }
        }
        return conditions;
    }

    // K₀ + springs with the constrained rows and columns replaced by those of the identity.
    [[nodiscard]] Eigen::SparseMatrix<double> dense_free(const NodalConditions& c) const {
        Eigen::MatrixXd K = tangent_stiffness(rest, Matrix3Xd::Zero(3, rest.node_count));
        for (std::size_t s = 0; s < c.spring_node.size(); ++s) {
            const auto k = c.spring_stiffness.col(static_cast<int>(s));
            K.block<3, 3>(3 * c.spring_node[s], 3 * c.spring_node[s]) +=
                Matrix3d{{k[0], k[3], k[5]}, {k[3], k[1], k[4]}, {k[5], k[4], k[2]}};
        }
        for (int d = 0; d < K.rows(); ++d) {
            if (!c.constrained.data()[d]) continue;
            K.row(d).setZero();
            K.col(d).setZero();
            K(d, d) = 1.0;
        }
        return K.sparseView();
    }

    [[nodiscard]] Matrix3Xd by_sparse_lu(const NodalConditions& c, Matrix3Xd force) const {
        force = c.constrained.select(0.0, force);
        const Eigen::SparseLU<Eigen::SparseMatrix<double>> lu(dense_free(c));
        const Eigen::VectorXd x = lu.solve(Eigen::VectorXd(force.reshaped()));
        return x.reshaped(3, force.cols());
    }

    Model model;
    RestState rest;
};

INSTANTIATE_TEST_SUITE_P(Elements, RestStiffnessTest, testing::Values(Element::T4, Element::AveragedPressureT4),
                         [](const auto& each) { return each.param == Element::T4 ? "T4" : "AveragedPressure"; });

TEST_P(RestStiffnessTest, SolveAgreesWithAnotherFactorisation) {
    const NodalConditions c = nodal_conditions(held_with_springs(2.0), rest.node_count);
    const Matrix3Xd force = random_forces(rest.node_count), expected = by_sparse_lu(c, force);
    const RestStiffness stiffness(rest, c);
    EXPECT_LT((stiffness.solve(force) - expected).norm(), 1e-10 * expected.norm());
    EXPECT_GT(stiffness.factor_nonzeros(), 1000);
}

TEST_P(RestStiffnessTest, OtherSpringsAreSolvedToTheToleranceAsked) {
    const RestStiffness stiffness(rest, nodal_conditions(held_with_springs(2.0), rest.node_count));
    const NodalConditions other = nodal_conditions(held_with_springs(0.3), rest.node_count);
    const Matrix3Xd force = random_forces(rest.node_count), expected = by_sparse_lu(other, force);
    EXPECT_LT((stiffness.solve(force, other, 1e-10) - expected).norm(), 1e-8 * expected.norm());
    EXPECT_LT((stiffness.solve(force, other, 1e-3) - expected).norm(), 1e-2 * expected.norm());
}

TEST_P(RestStiffnessTest, WithOtherSpringsIsTheSameAsMadeAnew) {
    const NodalConditions soft = nodal_conditions(held_with_springs(2.0), rest.node_count);
    const NodalConditions stiff = nodal_conditions(held_with_springs(200.0), rest.node_count);
    const RestStiffness before(rest, soft), after(rest, stiff, before);
    const Matrix3Xd force = random_forces(rest.node_count);
    const Matrix3Xd expected = by_sparse_lu(stiff, force);
    EXPECT_LT((after.solve(force) - expected).norm(), 1e-9 * expected.norm());
    // Neither the factor that lent its analysis nor one that borrowed from a borrower has changed.
    const RestStiffness again(rest, soft, after);
    EXPECT_LT((before.solve(force) - by_sparse_lu(soft, force)).norm(), 1e-9 * by_sparse_lu(soft, force).norm());
    EXPECT_LT((again.solve(force) - before.solve(force)).norm(), 1e-9 * before.solve(force).norm());
    Conditions other = held_with_springs(2.0);
    other.prescribed.pop_back();
    EXPECT_THROW(RestStiffness(rest, nodal_conditions(other, rest.node_count), before), InvalidInput);
}

TEST_P(RestStiffnessTest, SolvesColumnsAsOneByOne) {
    const NodalConditions c = nodal_conditions(held_with_springs(2.0), rest.node_count);
    const RestStiffness stiffness(rest, c);
    Eigen::MatrixXd forces(3 * rest.node_count, 3);
    for (int k = 0; k < 3; ++k) forces.col(k) = (k + 1) * random_forces(rest.node_count).reshaped();
    forces(7, 1) += 1;
    const Eigen::MatrixXd solved = stiffness.solve_columns(forces);
    for (int k = 0; k < 3; ++k) {
        const Matrix3Xd single = stiffness.solve(forces.col(k).reshaped(3, rest.node_count));
        EXPECT_LT((solved.col(k) - single.reshaped()).norm(), 1e-12 * single.norm()) << k;
    }
}

// Constrained ones among them, out of order.
TEST_P(RestStiffnessTest, TheInverseBetweenNodesIsThatOfForcesOneByOne) {
    const RestStiffness stiffness(rest, nodal_conditions(held_with_springs(2.0), rest.node_count));
    const std::vector<int> nodes{rest.node_count - 1, 0, 3, 17, rest.node_count / 2, 4};
    const Eigen::MatrixXd between = stiffness.inverse_between(nodes);
    for (std::size_t n = 0; n < nodes.size(); ++n)
        for (int c = 0; c < 3; ++c) {
            Matrix3Xd force = Matrix3Xd::Zero(3, rest.node_count);
            force(c, nodes[n]) = 1;
            const Matrix3Xd moved = stiffness.solve(force)(Eigen::all, nodes);
            EXPECT_LT((between.col(static_cast<int>(3 * n) + c) - moved.reshaped()).norm(), 1e-10 * between.norm());
        }
}

TEST_P(RestStiffnessTest, OtherConstraintsAreRefused) {
    const RestStiffness stiffness(rest, nodal_conditions(held_with_springs(2.0), rest.node_count));
    Conditions other = held_with_springs(2.0);
    other.prescribed.pop_back();
    EXPECT_THROW(static_cast<void>(
                     stiffness.solve(random_forces(rest.node_count), nodal_conditions(other, rest.node_count), 1e-6)),
                 InvalidInput);
}

TEST_P(RestStiffnessTest, LinearSolutionPassesThePatchTest) {
    const Matrix3d H{{0.02, 0.01, 0.0}, {-0.03, 0.01, 0.02}, {0.01, 0.0, -0.02}};
    Conditions conditions;
    for (int i = 0; i < model.mesh.node_count(); ++i) {
        const Vector3d x = model.mesh.nodes.col(i);
        const bool boundary = x.minCoeff() < 1e-9 || x.x() > 40 - 1e-9 || x.y() > 30 - 1e-9 || x.z() > 20 - 1e-9;
        if (boundary) conditions.prescribed.push_back({i, {true, true, true}, H * x});
    }
    const NodalConditions c = nodal_conditions(conditions, rest.node_count);
    ASSERT_LT(conditions.prescribed.size(), static_cast<std::size_t>(rest.node_count));
    const Matrix3Xd u = RestStiffness(rest, c).linear_solution(c);
    EXPECT_LT((u - H * model.mesh.nodes).cwiseAbs().maxCoeff(), 1e-12);  // mm
}

// A long box under a force, with springs pulling: the residual K u − f vanishes on the free degrees of freedom.
TEST_P(RestStiffnessTest, LinearSolutionBalancesSpringsAndForces) {
    Conditions conditions = held_with_springs(2.0);
    conditions.prescribed.front().displacement << 0.1, 0.2, 0.3;
    conditions.external_force = random_forces(rest.node_count);
    const NodalConditions c = nodal_conditions(conditions, rest.node_count);
    const Matrix3Xd u = RestStiffness(rest, c).linear_solution(c);
    const Eigen::VectorXd Ku = tangent_stiffness(rest, Matrix3Xd::Zero(3, rest.node_count)) * u.reshaped();
    Matrix3Xd residual = conditions.external_force - Ku.reshaped(3, rest.node_count);
    for (const Spring& spring : conditions.springs) {
        residual.col(spring.node) += spring.stiffness * (spring.target - u.col(spring.node));
    }
    EXPECT_LT(c.constrained.select(0.0, residual).cwiseAbs().maxCoeff(), 1e-10 * Ku.cwiseAbs().maxCoeff());
    EXPECT_EQ((u.col(0) - Vector3d(0.1, 0.2, 0.3)).norm(), 0.0);
}

TEST_P(RestStiffnessTest, ElasticResistanceIsThatOfSmallDisplacements) {
    constexpr double small = 1e-6;
    const RestStiffness stiffness(rest, nodal_conditions(held_with_springs(0.5), rest));
    const Matrix3Xd u = random_forces(rest.node_count), expected = internal_force(rest, small * u) / small;
    EXPECT_LT((stiffness.elastic_resistance(u) - expected).norm(), 1e-5 * expected.norm());
}

TEST_P(RestStiffnessTest, DiagonalAndLowestEigenvalueAgreeWithADenseSolver) {
    model.mesh = meshing::box_mesh({30.0, 20.0, 20.0}, {2, 2, 2}, 0.1, 5);
    rest = rest_state(model);
    const NodalConditions c = nodal_conditions(held_with_springs(2.0), rest.node_count);
    const RestStiffness stiffness(rest, c);
    const Eigen::MatrixXd K = dense_free(c);
    const Matrix3Xd diagonal = stiffness.diagonal(c);
    EXPECT_LT((diagonal.reshaped() - K.diagonal()).cwiseAbs().maxCoeff(), 1e-12 * K.diagonal().maxCoeff());

    const Eigen::VectorXd scale = K.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> modes(scale.asDiagonal() * K * scale.asDiagonal());
    EXPECT_NEAR(stiffness.lowest_eigenvalue(), modes.eigenvalues()[0], 1e-3 * modes.eigenvalues()[0]);
    EXPECT_GT(stiffness.approximate_highest_eigenvalue(), modes.eigenvalues().maxCoeff());
    EXPECT_LT(stiffness.approximate_highest_eigenvalue(), 1.11 * modes.eigenvalues().maxCoeff());
}

TEST_P(RestStiffnessTest, TheLowestEigenvalueWithoutAFactorIsAboutThatWithOne) {
    model.mesh = meshing::box_mesh({60.0, 30.0, 30.0}, {10, 5, 5}, 0.1, 5);
    rest = rest_state(model);
    const auto held = [&](double springs) { return nodal_conditions(held_with_springs(springs), rest.node_count); };
    const RestStiffness first(rest, held(0.3)), softer(rest, held(1e-4), first), stiffer(rest, held(300), first);
    for (const RestStiffness* stiffness : {&first, &softer, &stiffer}) {
        const double about = stiffness->approximate_lowest_eigenvalue(), exact = stiffness->lowest_eigenvalue();
        EXPECT_GE(about, (1 - 1e-4) * exact);
        EXPECT_LE(about, 1.05 * exact);
    }
}

TEST_P(RestStiffnessTest, TheSlowestModeOfOtherSpringsIsWhereASearchMayBegin) {
    model.mesh = meshing::box_mesh({60.0, 30.0, 30.0}, {10, 5, 5}, 0.1, 5);
    rest = rest_state(model);
    const auto held = [&](double springs) { return nodal_conditions(held_with_springs(springs), rest.node_count); };
    const RestStiffness first(rest, held(0.3));
    for (const double springs : {1e-2, 0.3, 10.0}) {
        const RestStiffness next(rest, held(springs), first, first.approximate_slowest_mode());
        const double about = next.approximate_lowest_eigenvalue(), exact = next.lowest_eigenvalue();
        EXPECT_GE(about, (1 - 1e-4) * exact) << springs;
        EXPECT_LE(about, 2 * exact) << springs;
    }
}

TEST_P(RestStiffnessTest, TheLowestEigenvalueOfFewNodesNeedsNoFactor) {
    model.mesh = meshing::box_mesh({20.0, 20.0, 20.0}, {1, 1, 1});
    rest = rest_state(model);
    for (const double springs : {1e-6, 1.0, 1e6}) {
        const RestStiffness stiffness(rest, nodal_conditions(held_with_springs(springs), rest.node_count));
        const double exact = stiffness.lowest_eigenvalue();
        EXPECT_NEAR(stiffness.approximate_lowest_eigenvalue(), exact, 0.05 * exact) << springs;
    }
}

TEST_P(RestStiffnessTest, TwoFactorsMadeTogetherAreThoseMadeOneByOne) {
    const NodalConditions soft = nodal_conditions(held_with_springs(2.0), rest.node_count);
    const NodalConditions stiff = nodal_conditions(held_with_springs(200.0), rest.node_count);
    const RestStiffness first(rest, soft), second(rest, stiff, first);
    factorise_together(first, second);
    const Matrix3Xd force = random_forces(rest.node_count);
    EXPECT_EQ(first.solve(force), RestStiffness(rest, soft).solve(force));
    EXPECT_EQ(second.solve(force), RestStiffness(rest, stiff).solve(force));
}

TEST_P(RestStiffnessTest, UnheldTissueIsRefusedByName) {
    using testing::HasSubstr;
    using testing::ThrowsMessage;
    const auto construct = [&](const Conditions& conditions) {
        return [&] { RestStiffness(rest, nodal_conditions(conditions, rest.node_count)); };
    };
    EXPECT_THAT(construct({}), ThrowsMessage<InvalidInput>(HasSubstr("nothing holds the tissue")));
    Conditions hinge;  // two nodes leave a turn about the line through them
    hinge.prescribed = {{0, {true, true, true}, Vector3d::Zero()}, {1, {true, true, true}, Vector3d::Zero()}};
    EXPECT_THAT(construct(hinge), ThrowsMessage<InvalidInput>(HasSubstr("1 of 6 rigid motions")));
    hinge.springs.push_back({model.mesh.node_count() - 1, Matrix3d::Identity(), Vector3d::Zero()});
    EXPECT_NO_THROW(construct(hinge)());
}

TEST_P(RestStiffnessTest, ASecondPieceThatFloatsIsNamed) {
    const int nodes = model.mesh.node_count(), tets = model.mesh.tet_count();
    meshing::TetMesh pair = model.mesh;
    pair.nodes.conservativeResize(3, 2 * nodes);
    pair.nodes.rightCols(nodes) = model.mesh.nodes.colwise() + Vector3d(100.0, 0.0, 0.0);
    pair.tets.conservativeResize(4, 2 * tets);
    pair.tets.rightCols(tets) = model.mesh.tets.array() + nodes;
    pair.labels.conservativeResize(2 * tets);
    pair.labels.tail(tets) = model.mesh.labels;
    const Conditions conditions = held_with_springs(2.0);  // of the first piece
    model.mesh = pair;
    rest = rest_state(model);
    EXPECT_THAT([&] { RestStiffness(rest, nodal_conditions(conditions, rest.node_count)); },
                testing::ThrowsMessage<InvalidInput>(testing::HasSubstr("node " + std::to_string(nodes))));
}

TEST_P(RestStiffnessTest, EverythingPrescribedNeedsNoFactor) {
    Conditions conditions;
    for (int i = 0; i < rest.node_count; ++i) {
        conditions.prescribed.push_back({i, {true, true, true}, Vector3d(1.0, 2.0, 3.0)});
    }
    const NodalConditions c = nodal_conditions(conditions, rest.node_count);
    EXPECT_EQ(RestStiffness(rest, c).linear_solution(c), c.imposed);
}

}  // namespace
}  // namespace tissuewarp::tled
