// Factors over the elimination tree against Eigen's, supernode by supernode in one thread, and against CHOLMOD's own.
#include "tled/stiffness/supernodes.hpp"
#include "tled/blas_threads.hpp"
#include "tled/stiffness/cholmod_factor.hpp"

#include <gtest/gtest.h>
#include <Eigen/SparseCholesky>

#include <oneapi/tbb/global_control.h>

#include <random>
#include <vector>

namespace tissuewarp::tled::detail {
namespace {

using Sparse = Eigen::SparseMatrix<double>;

/// The lower triangle of random springs between the neighbours of a lattice of n³ nodes, each with three unknowns, all
/// of them held a little.
Sparse lattice(int n, unsigned seed) {
    std::mt19937 generator(seed);
    std::uniform_real_distribution<double> number(-1, 1);
    std::vector<Eigen::Matrix3d> diagonal(static_cast<std::size_t>(n * n * n), 0.01 * Eigen::Matrix3d::Identity());
    std::vector<Eigen::Triplet<double>> entries;
    const auto add = [&](int row, int column, const Eigen::Matrix3d& block) {
        for (int r = 0; r < 3; ++r)
            for (int c = 0; c < 3; ++c)
                if (3 * row + r >= 3 * column + c) entries.emplace_back(3 * row + r, 3 * column + c, block(r, c));
    };
    for (int p = 0; p < n * n * n; ++p)
        for (int q = p + 1; q < n * n * n; ++q) {
            const int across =
                std::max({std::abs(p % n - q % n), std::abs(p / n % n - q / n % n), q / n / n - p / n / n});
            if (q / n / n - p / n / n > 1) break;
            if (across > 1) continue;
            Eigen::Matrix3d half;
            for (double& value : half.reshaped()) value = number(generator);
            const Eigen::Matrix3d spring = half * half.transpose();
            add(q, p, -spring);
            diagonal[static_cast<std::size_t>(p)] += spring;
            diagonal[static_cast<std::size_t>(q)] += spring;
        }
    for (int p = 0; p < n * n * n; ++p) add(p, p, diagonal[static_cast<std::size_t>(p)]);
    Sparse lower(3 * n * n * n, 3 * n * n * n);
    lower.setFromTriplets(entries.begin(), entries.end());
    return lower;
}

std::vector<int> nodes(const Sparse& lower) {
    std::vector<int> node(static_cast<std::size_t>(lower.cols()));
    for (std::size_t d = 0; d < node.size(); ++d) node[d] = static_cast<int>(d / 3);
    return node;
}

class SupernodesTest : public ::testing::Test {
protected:
    void SetUp() override { let_solves_take_one_blas_thread(true); }
    void TearDown() override { let_solves_take_one_blas_thread(false); }
};

TEST_F(SupernodesTest, SolvesAsEigenDoes) {
    for (const int n : {1, 2, 5, 9}) {
        const Sparse lower = lattice(n, static_cast<unsigned>(n));
        CholmodFactor factor(lower, nodes(lower));
        ASSERT_TRUE(factor.factorize(lower));
        const Eigen::SimplicialLLT<Sparse, Eigen::Lower> expected(lower);
        for (const int columns : {1, 3, 16, 37}) {
            const Eigen::MatrixXd b = Eigen::MatrixXd::Random(lower.rows(), columns), x = expected.solve(b);
            EXPECT_LT((factor.solve_columns(b) - x).norm(), 1e-11 * x.norm()) << n << ", " << columns << " columns";
        }
    }
}

/// Supernodes of many tiles, shared out: the stem of a larger tree has hundreds of columns.
TEST_F(SupernodesTest, TheSameBitsWithEveryNumberOfThreads) {
    const Sparse lower = lattice(15, 3);
    const Eigen::MatrixXd b = Eigen::MatrixXd::Random(lower.rows(), 20);
    const auto solved = [&](std::size_t threads) {
        const tbb::global_control most(tbb::global_control::max_allowed_parallelism, threads);
        CholmodFactor factor(lower, nodes(lower));
        EXPECT_TRUE(factor.factorize(lower));
        return factor.solve_columns(b);
    };
    const Eigen::MatrixXd one = solved(1);
    for (const std::size_t threads : {2, 5, 16}) EXPECT_EQ(solved(threads), one) << threads;
    const Sparse all = lower.selfadjointView<Eigen::Lower>();
    EXPECT_LT((all * one - b).norm(), 1e-11 * b.norm());
}

/// Where the BLAS may not take one thread CHOLMOD makes the numbers itself.
TEST_F(SupernodesTest, TheSameAsCholmods) {
    const Sparse lower = lattice(11, 4);
    const Eigen::MatrixXd b = Eigen::MatrixXd::Random(lower.rows(), 5);
    const auto solved = [&](bool one_thread) {
        let_solves_take_one_blas_thread(one_thread);
        CholmodFactor factor(lower, nodes(lower));
        EXPECT_TRUE(factor.factorize(lower));
        return factor.solve_columns(b);
    };
    const Eigen::MatrixXd x = solved(false);
    EXPECT_LT((solved(true) - x).norm(), 1e-11 * x.norm());
}

TEST_F(SupernodesTest, AnotherMatrixOfTheSamePattern) {
    const Sparse lower = lattice(6, 5);
    const CholmodFactor first(lower, nodes(lower));
    CholmodFactor factor = first.analysis();
    for (const double scale : {1.0, 3.0}) {
        ASSERT_TRUE(factor.factorize(scale * lower));
        const Eigen::VectorXd b = Eigen::VectorXd::Random(lower.rows());
        const Sparse all = lower.selfadjointView<Eigen::Lower>();
        EXPECT_LT((scale * (all * factor.solve(b)) - b).norm(), 1e-11 * b.norm());
    }
}

TEST_F(SupernodesTest, KnowsWhatIsNotPositiveDefinite) {
    Sparse lower = lattice(8, 6);
    CholmodFactor factor(lower, nodes(lower));
    ASSERT_TRUE(factor.factorize(lower));
    for (const int at : {0, 700, 1535}) {
        Sparse other = lower;
        other.coeffRef(at, at) = -1;
        EXPECT_FALSE(factor.factorize(other)) << at;
    }
    EXPECT_TRUE(factor.factorize(lower));
}

}  // namespace
}  // namespace tissuewarp::tled::detail
