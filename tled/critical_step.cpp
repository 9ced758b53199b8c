#include "tled/critical_step.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>

#include "core/errors.hpp"
#include "tled/model/kinematics.hpp"
#include "tled/model/vectors.hpp"

namespace tissuewarp::tled {

using detail::fixed_vector;
using detail::largest_norm;
using Eigen::Matrix3Xd;

HighestMode highest_mode(Engine& engine, const Matrix3Xd& mass, const Matrix3Xd& displacement, int iterations,
                         const Matrix3Xd* start) {
    const Matrix3Xd still = Matrix3Xd::Zero(3, displacement.cols());
    engine.set_state(displacement, still);
    const Matrix3Xd base = engine.displacement();  // as the engine rounds it
    const Matrix3Xd residual = engine.residual();
    // Large enough to stand clear of round-off in u, small enough to stay near the tangent.
    const double amplitude = 0.3 * std::max(std::cbrt(engine.precision()), 1e-3);  // mm
    HighestMode mode{.shape = start ? *start : fixed_vector(displacement.cols())};
    mode.force_evaluations = 1;
    for (int i = 0; i < iterations; ++i) {
        const double size = largest_norm(mode.shape);
        if (!(size > 0) || !std::isfinite(size)) break;
        engine.set_state(base + amplitude / size * mode.shape, still);
        const Matrix3Xd moved = engine.displacement() - base;  // constrained nodes did not follow
        const Matrix3Xd change = residual - engine.residual();
        ++mode.force_evaluations;
        const double denominator = (moved.array().square() * mass.array()).sum();
        if (!(denominator > 0)) break;  // nothing is free
        mode.eigenvalue = (moved.array() * change.array()).sum() / denominator;
        mode.shape = change.cwiseQuotient(mass);
    }
    const double size = largest_norm(mode.shape);
    if (size > 0) mode.shape /= size;
    engine.set_state(displacement, still);
    return mode;
}

Eigen::VectorXd element_step_bounds(const RestState& rest, double density) {
    Eigen::VectorXd steps(rest.element_count());
    for (const MaterialBlock& block : rest.blocks) {
        const Material& material = rest.materials[static_cast<std::size_t>(block.material)];
        const double mu = shear_modulus(material), lambda = p_wave_modulus(material) - 2 * mu;
        for (int e = block.begin; e < block.end; ++e) {
            const Eigen::Matrix<double, 3, 4> gradient = detail::shape_gradients(rest, e);
            const Eigen::Matrix3d G = gradient * gradient.transpose();
            const double largest =
                Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(G, Eigen::EigenvaluesOnly).eigenvalues().maxCoeff();
            steps[e] = 2 / std::sqrt(4 / density * (lambda * G.trace() + 2 * mu * largest));
        }
    }
    return steps;
}

MassScaling scaled_mass(const RestState& rest, double density, double step) {
    if (!(step > 0) || !(density > 0))
        throw InvalidInput("mass scaling needs a positive time step and density, not " + std::to_string(step) +
                           " s and " + std::to_string(density) + " kg/mm3");
    const Eigen::VectorXd bounds = element_step_bounds(rest, density);
    Eigen::VectorXd added = Eigen::VectorXd::Zero(rest.node_count);
    MassScaling result;
    for (int e = 0; e < rest.element_count(); ++e) {
        if (bounds[e] >= step) continue;
        ++result.scaled_elements;
        const double extra = (std::pow(step / bounds[e], 2) - 1) * density * rest.volume[e] / 4;
        for (const int node : rest.nodes.col(e)) added[node] += extra;
    }
    result.added_fraction = added.sum() / rest.lumped_mass.sum();
    result.mass = (rest.lumped_mass + added).transpose().replicate(3, 1);
    return result;
}

}  // namespace tissuewarp::tled
