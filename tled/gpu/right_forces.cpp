#include "tled/gpu/right_forces.hpp"

#include "core/errors.hpp"
#include "shaders/catalogue.hpp"
#include "tled/model/internal_force.hpp"
#include "tled/model/kinematics.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

namespace tissuewarp::tled::detail {

using Eigen::Matrix3Xd;

namespace {

/// A displacement by node number that makes every element pull: strains of some per cent, and in no sliver more than a
/// tenth. The height above a face is 1/|∇N|.
Matrix3Xd test_displacement(const RestState& rest) {
    double least_height = std::numeric_limits<double>::infinity();
    for (int e = 0; e < rest.element_count(); ++e)
        least_height = std::min(least_height, 1 / shape_gradients(rest, e).colwise().norm().maxCoeff());
    const double edge = std::cbrt(rest.volume.sum() / (rest.element_count() / 6.0));
    const double size = std::min(0.01 * edge, 0.05 * least_height);
    Matrix3Xd u(3, rest.node_count);
    for (Eigen::Index a = 0; a < u.cols(); ++a)
        u.col(a) << std::sin(0.37 * static_cast<double>(a)), std::cos(0.23 * static_cast<double>(a)),
            std::sin(0.51 * static_cast<double>(a) + 1);
    return size * u;
}

}  // namespace

void require_limits(const shaders::Device& device) {
    const auto offers = [&](int count, const char* what, int needed) {
        if (count >= needed) return;
        throw GpuUnavailable(device.renderer() + " offers " + std::to_string(count) + " " + what +
                             "; the solver needs " + std::to_string(needed) + "; take the CPU engine");
    };
    offers(device.limits().storage_blocks, "storage blocks per shader", shaders::storage_blocks_of_passes);
    offers(device.limits().storage_bindings, "storage bindings", 24);  // to which chunks/bindings.glsl counts
}

void require_right_forces(Engine& engine, const RestState& rest) {
    const Matrix3Xd still = Matrix3Xd::Zero(3, rest.node_count);
    const Matrix3Xd u = test_displacement(rest);
    const Matrix3Xd expected = internal_force(rest, u);
    engine.set_state(u, still);
    const double error = (engine.internal_force() - expected).norm() / expected.norm();
    engine.set_state(still, still);
    if (error < 1e-3) return;
    throw GpuUnavailable(engine.description() + " computes forces that are off by " + std::to_string(100 * error) +
                         " %: its driver cannot be trusted; take another device or the CPU engine");
}

}  // namespace tissuewarp::tled::detail
