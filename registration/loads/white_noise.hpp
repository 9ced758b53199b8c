#pragma once
/// Independent random numbers, the same with every standard library.

#include <Eigen/Core>

#include <random>

namespace tissuewarp::registration::detail {

/// Mean 0, variance 1 (Box & Muller 1958), column by column.
Eigen::MatrixXd white_noise(Eigen::Index rows, Eigen::Index columns, std::mt19937_64& generator);

/// In (0, 1).
inline double uniform(std::mt19937_64& generator) {
    return (double(generator() >> 11) + 0.5) * 0x1p-53;
}

}  // namespace tissuewarp::registration::detail
