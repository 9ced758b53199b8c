/// Smooth displacements of a mesh, and the stiffness in two levels, against dense matrices and the factor.
#include "tled/stiffness/two_level.hpp"

#include "meshing/primitives.hpp"
#include "tled/model/springs.hpp"
#include "tled/stiffness/rest_stiffness.hpp"

#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include <cmath>
#include <random>

namespace tissuewarp::tled::detail {
namespace {

using Eigen::Matrix3Xd;
using Eigen::MatrixXd;
using Eigen::Vector3d;

MatrixXd random_columns(Eigen::Index rows, Eigen::Index columns) {
    std::mt19937 generator(5);
    MatrixXd result(rows, columns);
    for (double& value : result.reshaped()) value = static_cast<double>(generator()) / generator.max() - 0.5;
    return result;
}

/// A cube of 40 mm, held by springs on its lowest nodes, one of them fixed in z.
struct Body {
    RestState rest;
    NodalConditions conditions;
    BlockRows K;
    std::vector<int> index;

    explicit Body(Element element, int cells) {
        Model model;
        model.element = element;
        model.mesh = meshing::box_mesh({40, 40, 40}, {cells, cells, cells});
        model.materials[1] = neo_hookean_lnj(3.0, 0.45);
        rest = rest_state(model);
        Conditions c;
        for (int i = 0; i < rest.node_count; ++i)
            if (rest.position(2, i) < 1e-6)
                c.springs.push_back({i, 2.0 * Eigen::Matrix3d::Identity(), Vector3d::Zero()});
        c.prescribed.push_back({0, {false, false, true}, Vector3d::Zero()});
        conditions = nodal_conditions(c, rest.node_count);
        K = assembled(stiffness(rest, Matrix3Xd::Zero(3, rest.node_count)), Triangle::Full);
        for (std::size_t s = 0; s < conditions.spring_node.size(); ++s)
            K.diagonal(conditions.spring_node[s]) += spring_matrix(conditions, static_cast<int>(s));
        for (int i = 0; i < K.rows(); ++i)
            for (int k = K.offset[i]; k < K.offset[i + 1]; ++k) {
                if (i == 0) K.block[k].row(2).setZero();
                if (K.column[k] == 0) K.block[k].col(2).setZero();
            }
    }
    [[nodiscard]] MatrixXd dense() const {
        MatrixXd result = MatrixXd::Zero(3 * K.rows(), 3 * K.rows());
        for (int i = 0; i < K.rows(); ++i)
            for (int k = K.offset[i]; k < K.offset[i + 1]; ++k) result.block<3, 3>(3 * i, 3 * K.column[k]) = K.block[k];
        return result;
    }
    [[nodiscard]] TwoLevel two_level(int cells) const {
        const auto product = [this](const Matrix3Xd& x) {
            Matrix3Xd y = Matrix3Xd::Zero(3, x.cols());
            for (int i = 0; i < K.rows(); ++i)
                for (int k = K.offset[i]; k < K.offset[i + 1]; ++k) y.col(i) += K.block[k] * x.col(K.column[k]);
            return y;
        };
        return {K, product, rest.position, conditions.constrained, cells};
    }
};

class TwoLevelTest : public testing::TestWithParam<Element> {
protected:
    Body body{GetParam(), 6};
    int rows = 3 * body.rest.node_count;
};
INSTANTIATE_TEST_SUITE_P(Elements, TwoLevelTest, testing::Values(Element::T4, Element::AveragedPressureT4),
                         [](const auto& each) { return each.param == Element::T4 ? "T4" : "AveragedPressure"; });

TEST(Lattice, CarriesAffineDisplacementsAndTheirForces) {
    const Matrix3Xd nodes = 50 * random_columns(3, 400);
    const Lattice lattice = lattice_about(nodes, 30);
    EXPECT_NEAR(lattice.cell_count(), 30, 8);
    EXPECT_LT((lattice.weight.colwise().sum().array() - 1).abs().maxCoeff(), 1e-12);
    const MatrixXd P = prolonged(lattice, MatrixXd::Identity(3 * lattice.point_count, 3 * lattice.point_count));
    const MatrixXd forces = random_columns(nodes.size(), 4);
    EXPECT_LT((restricted(lattice, forces) - P.transpose() * forces).norm(), 1e-12 * forces.norm());
    const MatrixXd affine = (random_columns(3, 3) * nodes).reshaped();  // lies in the span of P
    EXPECT_LT((P * P.completeOrthogonalDecomposition().solve(affine) - affine).norm(), 1e-9 * affine.norm());
}

// Flat bodies fill another share of their box; a mesh coarser than the lattice has points that hardly a node is near.
TEST(Lattice, HasAboutTheCellsAskedFor) {
    Matrix3Xd sheet = 50 * random_columns(3, 20000);
    sheet.row(2).setZero();
    EXPECT_NEAR(lattice_about(sheet, 500).cell_count(), 500, 75);
    EXPECT_LE(lattice_about(sheet.leftCols(20), 500).cell_count(), 20);
}

TEST_P(TwoLevelTest, GalerkinIsTheProductOfDenseMatrices) {
    const Lattice lattice = lattice_about(body.rest.position, 40);
    const MatrixXd P = prolonged(lattice, MatrixXd::Identity(3 * lattice.point_count, 3 * lattice.point_count));
    const MatrixXd expected = P.transpose() * body.dense() * P;
    const BlockRows found = galerkin(lattice, body.K);
    MatrixXd dense = MatrixXd::Zero(expected.rows(), expected.cols());
    for (int i = 0; i < found.rows(); ++i)
        for (int k = found.offset[i]; k < found.offset[i + 1]; ++k)
            dense.block<3, 3>(3 * i, 3 * found.column[k]) = found.block[k];
    EXPECT_LT((dense - expected).norm(), 1e-12 * expected.norm());
}

// Forces of smooth displacements give these back; other forces displacements of less energy than the true ones. With a
// wrong sign, a lost constraint or points counted twice neither holds.
TEST_P(TwoLevelTest, SmoothDisplacementsAreFoundFromTheirForces) {
    const TwoLevel levels = body.two_level(40);
    const MatrixXd K = body.dense(), forces = random_columns(rows, 3);
    const MatrixXd smooth = levels.smooth_columns(forces);
    EXPECT_EQ(smooth.row(2).norm(), 0);
    EXPECT_LT((levels.smooth_columns(K * smooth) - smooth).norm(), 1e-6 * smooth.norm());
    MatrixXd free = K;
    free(2, 2) = 1;
    const MatrixXd exact = free.ldlt().solve(forces);
    for (int k = 0; k < 3; ++k) {
        const double energy = forces.col(k).dot(smooth.col(k));
        EXPECT_GT(energy, 0.05 * forces.col(k).dot(exact.col(k)));
        EXPECT_LT(energy, forces.col(k).dot(exact.col(k)));
    }
}

// Eigenvalues of cycle times K: with rough or smooth steps missing the least is below 0.02, with one of wrong sign or
// steps too long the largest is above 2.
TEST_P(TwoLevelTest, ACycleIsAboutTheInverse) {
    const TwoLevel levels = body.two_level(40);
    MatrixXd K = body.dense(), inverse(rows, rows);
    for (int d = 0; d < rows; ++d) {
        MatrixXd unit = MatrixXd::Zero(rows, 1);
        if (d != 2) unit(d) = 1;
        inverse.col(d) = levels.cycle(unit.reshaped(3, rows / 3)).reshaped();
    }
    inverse(2, 2) = 1;
    K(2, 2) = 1;
    EXPECT_LT((inverse - inverse.transpose()).norm(), 1e-8 * inverse.norm());
    const MatrixXd symmetric = 0.5 * (inverse + inverse.transpose());
    const Eigen::LLT<MatrixXd> root(K);
    const MatrixXd L = root.matrixL();
    const auto values = Eigen::SelfAdjointEigenSolver<MatrixXd>(L.transpose() * symmetric * L).eigenvalues();
    EXPECT_GT(values.minCoeff(), 0.15);
    EXPECT_LT(values.maxCoeff(), 1.05);
}

TEST(LargeMeshes, AreSolvedAsWithTheFactor) {
    const Body body(Element::T4, 25);
    const RestStiffness stiffness(body.rest, body.conditions);
    ASSERT_TRUE(stiffness.is_large());
    ASSERT_FALSE(RestStiffness(Body(Element::T4, 6).rest, Body(Element::T4, 6).conditions).is_large());
    Matrix3Xd force = Matrix3Xd::Zero(3, body.rest.node_count);
    for (Eigen::Index i = 0; i < force.cols(); ++i) {
        const Vector3d X = body.rest.position.col(i);
        force.col(i) << 0.01 * std::sin(X[2] / 10), 0.02, -0.01 * X[0] / 40;
    }
    const Matrix3Xd iterated = stiffness.solve_iteratively(force, body.conditions, 1e-4),
                    exact = stiffness.solve(force);
    EXPECT_LT((iterated - exact).norm(), 1e-3 * exact.norm());
    NodalConditions loaded = body.conditions;
    loaded.external_force = force;
    EXPECT_LT((stiffness.linear_solution(loaded, 1e-7) - stiffness.linear_solution(loaded)).norm(),
              1e-6 * exact.norm());
    EXPECT_NEAR(force.cwiseProduct(stiffness.precondition(force)).sum() / force.cwiseProduct(exact).sum(), 1, 0.1);
}

}  // namespace
}  // namespace tissuewarp::tled::detail
