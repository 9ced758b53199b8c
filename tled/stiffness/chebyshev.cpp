#include "tled/stiffness/chebyshev.hpp"

namespace tissuewarp::tled::detail {

using Eigen::Matrix3Xd;

double largest_eigenvalue(const Product& multiply, const Product& divide, Matrix3Xd start) {
    constexpr int steps = 10;
    double value = 1.0;
    for (int k = 0; k < steps && value > 0.0; ++k) {
        start = divide(multiply(start / value));
        value = start.norm();
    }
    return value > 0.0 ? 1.1 * value : 1.0;
}

Matrix3Xd every_wave_length(Eigen::Index count) {
    Matrix3Xd x(3, count);
    for (Eigen::Index i = 0; i < count; ++i) x.col(i) << 1.0, (i % 2 == 0 ? 1.0 : -1.0), double(i % 3) - 1.0;
    return x;
}

void chebyshev_steps(const Product& multiply, const Product& divide, double largest, Matrix3Xd& x,
                     Matrix3Xd& residual) {
    const double centre = 0.625 * largest, radius = 0.375 * largest, ratio = centre / radius;
    const auto apply = [&](const Matrix3Xd& step) {
        x += step;
        residual -= multiply(step);
    };
    const Matrix3Xd first = divide(residual) / centre;
    apply(first);
    const double rho = 1.0 / (2.0 * ratio - 1.0 / ratio);
    apply(rho / ratio * first + 2.0 * rho / radius * divide(residual));
}

}  // namespace tissuewarp::tled::detail
