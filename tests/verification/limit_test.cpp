// The extrapolation from four meshes.

#include "tests/verification/limit.hpp"
#include "core/errors.hpp"

#include <gtest/gtest.h>
#include <Eigen/LU>

#include <cmath>

namespace tissuewarp::verification {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

const std::vector<double> cells{4.0, 8.0, 12.0, 16.0};

template <class Value>
std::vector<VectorXd> on_meshes(Value&& value) {
    std::vector<VectorXd> result;
    for (const double n : cells) result.push_back(value(1.0 / n));
    return result;
}

TEST(Limit, RecoversOnePowerExactly) {
    for (const double order : {0.7, 1.7, 2.0}) {
        const Limit found = limit_of(
            cells, on_meshes([&](double h) {
                return VectorXd(Eigen::Vector2d(7.0 + 0.3 * std::pow(h, order), -1.0 + 2.0 * std::pow(h, order)));
            }),
            2.0);
        EXPECT_NEAR(found.order, order, 1e-6);
        EXPECT_NEAR(found.value[0], 7.0, 1e-8);
        EXPECT_NEAR(found.value[1], -1.0, 1e-8);
        EXPECT_LT(found.standard_error, 1e-8);
    }
}

// An order above the element's is told, but the limit is that of the element's order: farther away from the finest
// value than the true limit, 1, is.
TEST(Limit, BelievesNoOrderAboveTheElements) {
    const auto cubic = [](double h) { return VectorXd(VectorXd::Constant(1, 1.0 + h * h * h)); };
    const Limit found = limit_of(cells, on_meshes(cubic), 2.0);
    EXPECT_NEAR(found.order, 3.0, 1e-6);
    EXPECT_LT(found.value[0], 1.0);
    EXPECT_GT(found.standard_error, 0.0);
}

TEST(Limit, BelievesNoOrderBelowOneHalf) {
    const auto slow = [](double h) { return VectorXd(VectorXd::Constant(1, 1.0 + std::pow(h, 0.3))); };
    const Limit found = limit_of(cells, on_meshes(slow), 2.0);
    EXPECT_NEAR(found.order, 0.3, 1e-6);
    EXPECT_GT(found.value[0], 1.0);  // half an order instead of 0.3 ends before the true limit
    EXPECT_GT(found.standard_error, 0.0);
}

TEST(Limit, HasNoOrderWhereValuesDiverge) {
    const Limit found =
        limit_of(cells, on_meshes([](double h) { return VectorXd(VectorXd::Constant(1, 1.0 / h)); }), 2.0);
    EXPECT_TRUE(std::isnan(found.order));
}

// The closed form of the error against the covariance of all parameters at once, derivatives by differences.
TEST(Limit, StandardErrorIsThatOfNonlinearLeastSquares) {
    const Eigen::Vector3d limit(7.0, -1.0, 0.5), factor(0.3, 2.0, -1.2);
    const auto noisy = [&](double h) {
        return VectorXd(limit + std::pow(h, 1.4) * factor + 0.01 * Eigen::Vector3d(std::sin(50.0 / h), h, -h * h));
    };
    const std::vector<VectorXd> values = on_meshes(noisy);
    const Limit found = limit_of(cells, values, 2.0);
    ASSERT_GT(found.order, 0.5);
    ASSERT_LT(found.order, 2.0);

    const auto model = [&](const VectorXd& x) {  // u₀, α, p
        VectorXd u(12);
        for (Eigen::Index k = 0; k < 4; ++k) {
            const double h = 16.0 / cells[static_cast<std::size_t>(k)];
            u.segment<3>(3 * k) = x.head<3>() + std::pow(h, x[6]) * x.segment<3>(3);
        }
        return u;
    };
    VectorXd measured(12);
    for (Eigen::Index k = 0; k < 4; ++k) measured.segment<3>(3 * k) = values[static_cast<std::size_t>(k)];
    VectorXd x(7);
    x << found.value, VectorXd::Zero(3), found.order;
    for (int c = 0; c < 3; ++c) {  // α by least squares with the found u₀ and p
        double upper = 0.0, lower = 0.0;
        for (Eigen::Index k = 0; k < 4; ++k) {
            const double power = std::pow(16.0 / cells[static_cast<std::size_t>(k)], found.order);
            upper += power * (measured[3 * k + c] - found.value[c]);
            lower += power * power;
        }
        x[3 + c] = upper / lower;
    }
    MatrixXd derivative(12, 7);
    for (int c = 0; c < 7; ++c) {
        constexpr double step = 1e-6;
        VectorXd up = x, down = x;
        up[c] += step;
        down[c] -= step;
        derivative.col(c) = (model(up) - model(down)) / (2.0 * step);
    }
    const VectorXd residual = measured - model(x);
    EXPECT_LT((derivative.transpose() * residual).norm(), 1e-6);  // the least sum of squares
    const MatrixXd covariance = residual.squaredNorm() / 5.0 * (derivative.transpose() * derivative).inverse();
    EXPECT_NEAR(found.standard_error, std::sqrt(covariance.topLeftCorner<3, 3>().trace() / 3.0),
                1e-5 * found.standard_error);
}

TEST(Limit, NeedsFourMeshes) {
    const VectorXd one = VectorXd::Ones(1);
    EXPECT_THROW(limit_of({4.0, 8.0, 16.0}, {one, one, one}, 2.0), InvalidInput);
}

}  // namespace
}  // namespace tissuewarp::verification
