#include "tled/stiffness/conjugate_gradients.hpp"

#include "core/errors.hpp"

#include <cmath>
#include <string>

namespace tissuewarp::tled::detail {

using Eigen::Matrix3Xd;

Matrix3Xd conjugate_gradients(const Product& product, const Product& precondition, const Matrix3Xd& force,
                              double relative_tolerance) {
    constexpr int max_iterations = 2000;
    const auto dot = [](const Matrix3Xd& a, const Matrix3Xd& b) { return a.cwiseProduct(b).sum(); };
    Matrix3Xd x = Matrix3Xd::Zero(3, force.cols()), r = force, z = precondition(r), p = z;
    double rz = dot(r, z);
    const double limit = relative_tolerance * relative_tolerance * rz;
    for (int iteration = 0; rz > limit; ++iteration) {
        const Matrix3Xd Kp = product(p);
        const double curvature = dot(p, Kp);
        if (iteration == max_iterations || !(curvature > 0.0)) {
            throw SolverFailure("conjugate gradients stopped at a relative residual of " +
                                std::to_string(relative_tolerance * std::sqrt(rz / limit)) + " after " +
                                std::to_string(iteration) +
                                " iterations: factorise the stiffness again with the present springs");
        }
        const double step = rz / curvature;
        x += step * p;
        r -= step * Kp;
        z = precondition(r);
        const double next = dot(r, z);
        p = z + next / rz * p;
        rz = next;
    }
    return x;
}

}  // namespace tissuewarp::tled::detail
