#include "tled/stiffness/two_level.hpp"

#include "tled/parallel/parallel.hpp"
#include "tled/stiffness/chebyshev.hpp"
#include "tled/stiffness/smooth_space.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

namespace tissuewarp::tled::detail {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::MatrixXd;

namespace {

Product division_by_blocks(const BlockRows& K) {
    auto inverse = std::make_shared<std::vector<Matrix3d>>(K.rows());
    parallel_for(0, K.rows(), [&](int i) {
        Matrix3d block = K.diagonal(i);
        for (int c = 0; c < 3; ++c)
            if (block(c, c) == 0) block(c, c) = 1.0;  // constrained
        (*inverse)[i] = block.inverse();
    });
    return [inverse](const Matrix3Xd& x) {
        Matrix3Xd result(3, x.cols());
        parallel_for(0, static_cast<int>(x.cols()), [&](int i) { result.col(i) = (*inverse)[i] * x.col(i); });
        return result;
    };
}

}  // namespace

TwoLevel::TwoLevel(const BlockRows& K, Product multiply, const Matrix3Xd& position,
                   const Eigen::Matrix<bool, 3, Eigen::Dynamic>& constrained, int cells)
    : lattice_(lattice_about(position, cells)),
      multiply_(std::move(multiply)),
      divide_(division_by_blocks(K)),
      constrained_(constrained),
      smooth_(smooth_factor(galerkin(lattice_, K))) {
    largest_ = largest_eigenvalue(multiply_, divide_, constrained_.select(0.0, every_wave_length(position.cols())));
}

int TwoLevel::suggested_cells(Eigen::Index nodes) {
    constexpr Eigen::Index nodes_of_cell = 14, most = 3000;
    return static_cast<int>(std::clamp<Eigen::Index>(nodes / nodes_of_cell, 1, most));
}

MatrixXd TwoLevel::smooth_columns(const MatrixXd& forces) const {
    const auto free = [&](MatrixXd x) {
        for (Eigen::Index k = 0; k < x.cols(); ++k) {
            Eigen::Map<Matrix3Xd> column(x.col(k).data(), 3, constrained_.cols());
            column = constrained_.select(0.0, column).eval();
        }
        return x;
    };
    return free(prolonged(lattice_, smooth_.solve_columns(restricted(lattice_, free(forces)))));
}

Matrix3Xd TwoLevel::cycle(Matrix3Xd residual) const {
    Matrix3Xd x = Matrix3Xd::Zero(3, residual.cols());
    chebyshev_steps(multiply_, divide_, largest_, x, residual);
    const MatrixXd smooth = smooth_columns(residual.reshaped());
    const Matrix3Xd step = smooth.reshaped(3, residual.cols());
    x += step;
    residual -= multiply_(step);
    chebyshev_steps(multiply_, divide_, largest_, x, residual);
    return x;
}

}  // namespace tissuewarp::tled::detail
