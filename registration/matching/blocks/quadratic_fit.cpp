#include "registration/matching/blocks/quadratic_fit.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>

namespace tissuewarp::registration::detail {

namespace {

/// Pseudo-inverse of the design matrix: the grid is symmetric, so the linear and mixed terms are plain moments and the
/// squares are freed of the constant by their mean of 2/3.
struct Moments {
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();

    void add(const Eigen::Vector3d& x, double cost) {
        gradient += cost / 18 * x;                 // Σ x² = 18
        hessian += cost / 12 * x * x.transpose();  // Σ x² y² = 12
        hessian.diagonal() += cost * ((x.array().square() - 2.0 / 3) / 3 - x.array().square() / 12).matrix();
    }
};

}  // namespace

std::optional<Quadratic> fit_quadratic(const std::array<double, 27>& costs) {
    Moments moments;
    double size = 0;
    for (int n = 0; n < 27; ++n) {
        const double cost = costs[static_cast<std::size_t>(n)];
        if (!std::isfinite(cost)) return std::nullopt;
        size = std::max(size, std::abs(cost));
        moments.add({n % 3 - 1.0, n / 3 % 3 - 1.0, n / 9 - 1.0}, cost);
    }
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes;
    axes.computeDirect(moments.hessian);
    const double largest = axes.eigenvalues()[2];
    if (!(largest > 1e-12 * size)) return std::nullopt;  // rounding
    Quadratic result{Eigen::Vector3d::Zero(), Eigen::Matrix3d::Zero(), largest};
    for (int a = 0; a < 3; ++a) {
        const double curvature = axes.eigenvalues()[a];
        const Eigen::Vector3d axis = axes.eigenvectors().col(a);
        if (curvature > 0) result.hessian += curvature * axis * axis.transpose();
        if (curvature > 0.01 * largest)
            result.minimum -= std::clamp(moments.gradient.dot(axis) / curvature, -1.0, 1.0) * axis;
    }
    return result;
}

}  // namespace tissuewarp::registration::detail
