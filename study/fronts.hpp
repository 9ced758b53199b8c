#pragma once
/// What measured points say: which of them nothing beats, and where more time stops to buy accuracy.

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <vector>

namespace tissuewarp::study {

struct Cost {
    double seconds = 0, error_mm = 0;
};

/// Those that no other beats in one without losing in the other, by rising time.
std::vector<std::size_t> pareto_front(const std::vector<Cost>& points);

/// The quickest of all points whose error is within `share` of the least: beyond it time buys nothing worth it.
/// Precondition: there are points.
std::size_t knee(const std::vector<Cost>& points, double share = 0.05);

/// A piece of the line on which a quantity is `level`.
using LevelSegment = std::array<Eigen::Vector2d, 2>;

/// By marching squares, linear in the logarithms of `x` (columns), `y` (rows), values and level, all positive; x and y
/// ascend. Squares with a value that is not finite are left out.
std::vector<LevelSegment> level_line(const std::vector<double>& x, const std::vector<double>& y,
                                     const Eigen::MatrixXd& values, double level);

}  // namespace tissuewarp::study
