// Forces of effects, face by face and in float64.

#include "core/errors.hpp"
#include "tled/nodal_effects.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace tissuewarp::tled {
namespace {

using Eigen::Matrix2d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using Edges = Eigen::Matrix<double, 3, 2>;

Edges edges(const Matrix3Xd& x, const Eigen::Vector3i& face) {
    return (Edges() << x.col(face[1]) - x.col(face[0]), x.col(face[2]) - x.col(face[0])).finished();
}

Matrix2d rest_map(const SurfaceEffects& effects, Eigen::Index face) {
    const auto d = effects.membrane_rest.col(face);
    return Matrix2d{{d[0], d[1]}, {0, d[2]}};
}

void add_pressures(const SurfaceEffects& effects, const Matrix3Xd& x, Matrix3Xd& force) {
    for (Eigen::Index f = 0; f < effects.pressure_faces.cols(); ++f) {
        const Edges e = edges(x, effects.pressure_faces.col(f));
        const Vector3d third = -effects.pressure[f] / 6 * e.col(0).cross(e.col(1));
        for (const int node : effects.pressure_faces.col(f)) force.col(node) += third;
    }
}

/// P = μ (F − F C⁻¹/det C) for F = [x₁ − x₀, x₂ − x₀] D⁻¹.
void add_membranes(const SurfaceEffects& effects, const Matrix3Xd& x, Matrix3Xd& force) {
    for (Eigen::Index f = 0; f < effects.membrane_faces.cols(); ++f) {
        const Matrix2d to_rest = rest_map(effects, f);
        const Edges F = edges(x, effects.membrane_faces.col(f)) * to_rest;
        const Matrix2d C = F.transpose() * F;
        const Edges P = F - F * C.inverse() / C.determinant();
        const Edges internal = effects.membrane_stiffness[f] * P * to_rest.transpose();
        const auto face = effects.membrane_faces.col(f);
        force.col(face[1]) -= internal.col(0);
        force.col(face[2]) -= internal.col(1);
        force.col(face[0]) += internal.rowwise().sum();
    }
}

void add_pair(const SlidingPair& pair, double g, Matrix3Xd& force) {
    force.col(pair.first) -= pair.stiffness * g * pair.normal;
    force.col(pair.second) += pair.stiffness * g * pair.normal;
}

void add_pairs(const SurfaceEffects& effects, const Matrix3Xd& u, Matrix3Xd& force) {
    for (const SlidingPair& pair : effects.sliding) add_pair(pair, overlap(pair, u), force);
    for (const SlidingPair& pair : effects.parting) add_pair(pair, std::max(overlap(pair, u), 0.0), force);
}

/// Six times the volume between faces and the origin.
double six_volumes(const Matrix3Xd& x, const Eigen::Vector3i& face) {
    return x.col(face[0]).dot(x.col(face[1]).cross(x.col(face[2])));
}

double pressure_energy(const SurfaceEffects& effects, const Matrix3Xd& X, const Matrix3Xd& x) {
    double energy = 0;
    for (Eigen::Index f = 0; f < effects.pressure_faces.cols(); ++f) {
        const Eigen::Vector3i face = effects.pressure_faces.col(f);
        energy += effects.pressure[f] / 6 * (six_volumes(x, face) - six_volumes(X, face));
    }
    return energy;
}

double membrane_energy(const SurfaceEffects& effects, const Matrix3Xd& x) {
    double energy = 0;
    for (Eigen::Index f = 0; f < effects.membrane_faces.cols(); ++f) {
        const Edges F = edges(x, effects.membrane_faces.col(f)) * rest_map(effects, f);
        const Matrix2d C = F.transpose() * F;
        energy += 0.5 * effects.membrane_stiffness[f] * (C.trace() + 1 / C.determinant() - 3);
    }
    return energy;
}

double energy_of_pairs(const SurfaceEffects& effects, const Matrix3Xd& u) {
    const auto square = [](double g) { return g * g; };
    double energy = 0;
    for (const SlidingPair& pair : effects.sliding) energy += 0.5 * pair.stiffness * square(overlap(pair, u));
    for (const SlidingPair& pair : effects.parting)
        energy += 0.5 * pair.stiffness * square(std::max(overlap(pair, u), 0.0));
    return energy;
}

/// Depth of a column's middle below the level, in column heights, from −½ (dry) to ½ (drowned).
double immersion(const NodalFluid& fluid, const Matrix3Xd& u, Eigen::Index node) {
    const double depth = fluid.level - fluid.rest_height[node] - fluid.up.dot(u.col(node));
    return std::clamp(depth / fluid.column_height[node], -0.5, 0.5);
}

/// Energy of the lift: its integral over the depth, from far below.
double fluid_energy(const NodalFluid& fluid, const Matrix3Xd& u) {
    double energy = 0;
    const Matrix3Xd rest = Matrix3Xd::Zero(3, u.cols());
    const auto potential = [&](const Matrix3Xd& at, Eigen::Index a) {
        const double s = immersion(fluid, at, a) + 0.5, h = fluid.column_height[a];
        const double depth = fluid.level - fluid.rest_height[a] - fluid.up.dot(at.col(a));
        return 0.5 * s * s * h + std::max(0.0, depth - 0.5 * h);
    };
    for (Eigen::Index a = 0; a < u.cols(); ++a) energy += fluid.weight[a] * (potential(u, a) - potential(rest, a));
    return energy;
}

/// Weights of the four samples about a point a fraction t past the second, and their derivatives (Keys 1981, eq. 15
/// with a = −1/2).
struct CubicWeights {
    std::array<double, 4> value, slope;
};
CubicWeights cubic_weights(double t) {
    return {{((-0.5 * t + 1) * t - 0.5) * t, (1.5 * t - 2.5) * t * t + 1, ((-1.5 * t + 2) * t + 0.5) * t,
             (0.5 * t - 0.5) * t * t},
            {(-1.5 * t + 2) * t - 0.5, (4.5 * t - 5) * t, (-4.5 * t + 4) * t + 0.5, (1.5 * t - 1) * t}};
}

}  // namespace

double overlap(const SlidingPair& pair, const Matrix3Xd& u) {
    return pair.normal.dot(u.col(pair.first) - u.col(pair.second));
}

Matrix3Xd surface_force(const SurfaceEffects& effects, const Matrix3Xd& position, const Matrix3Xd& u) {
    const Matrix3Xd x = position + u;
    Matrix3Xd force = Matrix3Xd::Zero(3, u.cols());
    add_pressures(effects, x, force);
    add_membranes(effects, x, force);
    add_pairs(effects, u, force);
    return force;
}

Matrix3Xd fluid_force(const NodalFluid& fluid, const Matrix3Xd& u) {
    Matrix3Xd force(3, u.cols());
    for (Eigen::Index a = 0; a < u.cols(); ++a)
        force.col(a) = fluid.weight[a] * (0.5 + immersion(fluid, u, a)) * fluid.up;
    return force;
}

double energy(const NodalEffects& effects, const Matrix3Xd& position, const Matrix3Xd& u) {
    const Matrix3Xd x = position + u;
    double sum = pressure_energy(effects.surface, position, x) + membrane_energy(effects.surface, x) +
                 energy_of_pairs(effects.surface, u);
    if (effects.fluid) sum += fluid_energy(*effects.fluid, u);
    return sum;
}

Distance distance_to(const Obstacle& obstacle, const Vector3d& position) {
    const DistanceGrid& grid = *obstacle.surface;
    const Eigen::Matrix3d& rotation = obstacle.placement.rotation;
    const Eigen::Matrix3d to_grid = grid.steps.inverse();
    const Vector3d in_body = rotation.transpose() * (position - obstacle.placement.shift);
    const Vector3d at = to_grid * (in_body - grid.origin);
    const Vector3d corner = at.array().floor();
    if (!((corner.array() >= 1).all() && (corner.array() <= grid.size.cast<double>().array() - 3).all()))
        return {std::numeric_limits<double>::infinity(), Vector3d::Zero()};
    const Eigen::Vector3i first = corner.cast<int>() - Eigen::Vector3i::Ones();
    const CubicWeights x = cubic_weights(at[0] - corner[0]), y = cubic_weights(at[1] - corner[1]),
                       z = cubic_weights(at[2] - corner[2]);
    const auto nx = static_cast<std::size_t>(grid.size[0]), ny = static_cast<std::size_t>(grid.size[1]);
    const float* d = grid.distance.data() + static_cast<std::size_t>(first[0]) +
                     nx * (static_cast<std::size_t>(first[1]) + ny * static_cast<std::size_t>(first[2]));
    double value = 0;
    Vector3d slope = Vector3d::Zero();
    for (std::size_t k = 0; k < 4; ++k) {
        double of_layer = 0, along_x = 0, along_y = 0;
        for (std::size_t j = 0; j < 4; ++j) {
            const float* row = d + nx * (j + ny * k);
            double of_row = 0, slope_of_row = 0;
            for (std::size_t i = 0; i < 4; ++i) {
                of_row += x.value[i] * double{row[i]};
                slope_of_row += x.slope[i] * double{row[i]};
            }
            of_layer += y.value[j] * of_row;
            along_x += y.value[j] * slope_of_row;
            along_y += y.slope[j] * of_row;
        }
        value += z.value[k] * of_layer;
        slope += Vector3d(z.value[k] * along_x, z.value[k] * along_y, z.slope[k] * of_layer);
    }
    return {value, rotation * (to_grid.transpose() * slope)};
}

Vector3d contact_correction(const Vector3d& normal, double depth, double friction, const Vector3d& v) {
    const Vector3d slip = v - normal.dot(v) * normal;
    const double length = slip.norm();
    Vector3d correction = depth * normal;
    if (length > 0) correction -= std::min(1.0, friction * depth / length) * slip;
    return correction;
}

Motion in_contact(const std::vector<Obstacle>& obstacles, const Vector3d& X, const Motion& free, double time_step) {
    Motion motion = free;
    for (const Obstacle& obstacle : obstacles) {
        const Distance distance = distance_to(obstacle, X + motion.u);
        const double steepness = distance.gradient.norm();
        if (!(distance.value < 0) || !(steepness > 0)) continue;
        const Vector3d of_body = obstacle.velocity.of_origin + obstacle.velocity.spin.cross(X + motion.u);
        const Vector3d correction = contact_correction(distance.gradient / steepness, -distance.value / steepness,
                                                       obstacle.friction, motion.v - time_step * of_body);
        motion.u += correction;
        motion.v += correction;
    }
    return motion;
}

}  // namespace tissuewarp::tled
