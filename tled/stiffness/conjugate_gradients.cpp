#include "tled/stiffness/conjugate_gradients.hpp"

#include "core/errors.hpp"
#include "tled/stiffness/dot.hpp"

#include <cmath>
#include <string>
#include <utility>

namespace tissuewarp::tled::detail {

using Eigen::Matrix3Xd;

Matrix3Xd conjugate_gradients(const Product& product, const Product& precondition, const Matrix3Xd& force,
                              double relative_tolerance) {
    constexpr int most_iterations = 2000;
    ConjugateGradients found =
        conjugate_gradients_within(most_iterations, product, precondition, force, relative_tolerance);
    if (found.relative_residual > relative_tolerance)
        throw SolverFailure("conjugate gradients stopped at a relative residual of " +
                            std::to_string(found.relative_residual) + " after " + std::to_string(found.iterations) +
                            " iterations: factorise the stiffness again with the present springs");
    return std::move(found.x);
}

ConjugateGradients conjugate_gradients_within(int most_iterations, const Product& product, const Product& precondition,
                                              const Matrix3Xd& force, double relative_tolerance) {
    ConjugateGradients found;
    found.x = Matrix3Xd::Zero(3, force.cols());
    Matrix3Xd r = force, z = precondition(r), p = z;
    double rz = dot(r, z);
    const double start = rz;
    if (!(start > 0.0)) found.relative_residual = 0.0;
    for (; found.relative_residual > relative_tolerance && found.iterations < most_iterations; ++found.iterations) {
        const Matrix3Xd Kp = product(p);
        const double curvature = dot(p, Kp);
        found.positive = curvature > 0.0;
        if (!found.positive) break;
        const double step = rz / curvature;
        found.x += step * p;
        r -= step * Kp;
        z = precondition(r);
        const double next = dot(r, z);
        p = z + next / rz * p;
        rz = next;
        found.relative_residual = std::sqrt(rz / start);
    }
    found.last = std::move(p);
    return found;
}

}  // namespace tissuewarp::tled::detail
