/// Distances between points along vessels and preoperative lines, both ways.
#include "registration/evaluation/curve_residual.hpp"

#include "core/errors.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

namespace tissuewarp::registration {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

Matrix3Xd straight(const Vector3d& from, const Vector3d& to, int count) {
    Matrix3Xd line(3, count);
    for (int n = 0; n < count; ++n) line.col(n) = from + (to - from) * (double(n) / (count - 1));
    return line;
}

std::vector<int> all_of(const Matrix3Xd& points) {
    std::vector<int> piece(static_cast<std::size_t>(points.cols()));
    std::iota(piece.begin(), piece.end(), 0);
    return piece;
}

/// Along x from 0 to 40 mm, and another that was not seen, 15 mm beside it.
const std::vector<Matrix3Xd> two_lines{straight({0, 0, 0}, {40, 0, 0}, 2), straight({0, 15, 0}, {40, 15, 0}, 9)};

TEST(CurveResidual, IsTheDistanceToTheLines) {
    Matrix3Xd points(3, 4);
    points << 10, 20, 30, 43, 0.5, -1, 13, 0, 0, 0, 0, 4;
    const CurveResidual residual = curve_residual(two_lines, points, {});
    EXPECT_EQ(residual.to_lines.count, 4);
    EXPECT_NEAR(residual.to_lines.mean, (0.5 + 1 + 2 + 5) / 4, 1e-12);
    EXPECT_NEAR(residual.to_lines.maximum, 5, 1e-12);  // beyond the end
    EXPECT_EQ(residual.from_lines.count, 0);           // loose points show no stretch
    EXPECT_EQ(residual.shown_mm, 0);
}

// A piece of 20 mm, 2 mm beside: of the line just those 20 mm count, and the other one not at all.
TEST(CurveResidual, OfAPartAsksForThatPartAlone) {
    const Matrix3Xd piece = straight({10, 0, 2}, {30, 0, 2}, 6);
    const CurveResidual residual = curve_residual(two_lines, piece, {all_of(piece)});
    EXPECT_EQ(residual.to_lines.count, 6);
    EXPECT_NEAR(residual.to_lines.mean, 2, 1e-12);
    EXPECT_EQ(residual.from_lines.count, 21);
    EXPECT_NEAR(residual.from_lines.maximum, 2, 1e-9);
    EXPECT_NEAR(residual.shown_mm, 20, 1e-9);
    const CurveResidual twice = curve_residual(two_lines, piece, {all_of(piece), {5, 4, 3}});
    EXPECT_EQ(twice.from_lines.count, 21) << "a place that is shown twice counts once";
}

// Points straight on, 20 mm apart, while the line makes a bow of 8 mm between them: the points are on it, it is not on
// the piece.
TEST(CurveResidual, FromTheLinesSeesABowBetweenPoints) {
    Matrix3Xd bow(3, 41);
    for (int n = 0; n <= 40; ++n) bow.col(n) = Vector3d(0.5 * n, 8 * std::sin(EIGEN_PI * n / 40), 0);
    Matrix3Xd ends(3, 2);
    ends << 0, 20, 0, 0, 0, 0;
    const CurveResidual residual = curve_residual({bow}, ends, {{0, 1}}, 0.25);
    EXPECT_NEAR(residual.to_lines.maximum, 0, 1e-9);
    EXPECT_NEAR(residual.from_lines.maximum, 8, 0.05);
    EXPECT_GT(residual.shown_mm, 26);
}

// From one line to another a piece shows neither.
TEST(CurveResidual, AcrossLinesShowsNothing) {
    Matrix3Xd points(3, 2);
    points << 20, 20, 0, 15, 0, 0;
    const CurveResidual residual = curve_residual(two_lines, points, {{0, 1}});
    EXPECT_EQ(residual.from_lines.count, 0);
    EXPECT_EQ(residual.shown_mm, 0);
}

TEST(CurveResidual, RefusesWhatHasNoDistance) {
    const Matrix3Xd point = Matrix3Xd::Zero(3, 1);
    EXPECT_THROW(curve_residual({}, point, {}), InvalidInput);
    EXPECT_THROW(curve_residual({Matrix3Xd::Zero(3, 1)}, point, {}), InvalidInput);
    EXPECT_THROW(curve_residual(two_lines, Matrix3Xd(3, 0), {}), InvalidInput);
    Matrix3Xd bad = point;
    bad(1, 0) = std::nan("");
    EXPECT_THROW(curve_residual(two_lines, bad, {}), InvalidInput);
    std::vector<Matrix3Xd> lines = two_lines;
    lines[1](0, 0) = INFINITY;
    EXPECT_THROW(curve_residual(lines, point, {}), InvalidInput);
}

}  // namespace
}  // namespace tissuewarp::registration
