// Lists by node and numbers of rest, from what a scene states.

#include "tled/nodal_effects.hpp"

#include "core/errors.hpp"
#include "tled/model/interpolation_reach.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>

namespace tissuewarp::tled {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Matrix3Xi;
using Eigen::Vector3d;

void require_node(int node, const RestState& rest, const char* what) {
    if (node < 0 || node >= rest.node_count)
        throw InvalidInput(std::string(what) + " names node " + std::to_string(node) + "; the mesh has nodes 0 to " +
                           std::to_string(rest.node_count - 1));
}

void require_faces(const Matrix3Xi& faces, const RestState& rest, const char* what) {
    for (Eigen::Index f = 0; f < faces.cols(); ++f) {
        for (const int node : faces.col(f)) require_node(node, rest, what);
        const Vector3d first = rest.position.col(faces(1, f)) - rest.position.col(faces(0, f));
        const Vector3d second = rest.position.col(faces(2, f)) - rest.position.col(faces(0, f));
        if (!(first.cross(second).norm() > 1e-12 * (first.squaredNorm() + second.squaredNorm())))
            throw InvalidInput(std::string(what) + " has face " + std::to_string(f) + " (nodes " +
                               std::to_string(faces(0, f)) + ", " + std::to_string(faces(1, f)) + ", " +
                               std::to_string(faces(2, f)) + ") without area");
    }
}

void require_finite(double value, const char* what) {
    if (!std::isfinite(value)) throw InvalidInput(std::string(what) + " is not finite");
}

void require_positive(double value, const char* what) {
    if (!(value > 0) || !std::isfinite(value))
        throw InvalidInput(std::string(what) + " is " + std::to_string(value) + "; it must be positive");
}

void append(Matrix3Xi& all, const Matrix3Xi& more) {
    const Eigen::Index before = all.cols();
    all.conservativeResize(3, before + more.cols());
    all.rightCols(more.cols()) = more;
}

void gather_pressures(const std::vector<SurfacePressure>& pressures, const RestState& rest, SurfaceEffects& effects) {
    for (const SurfacePressure& each : pressures) {
        require_faces(each.faces, rest, "a pressure");
        require_finite(each.pressure, "a pressure (kPa)");
        append(effects.pressure_faces, each.faces);
        const Eigen::Index before = effects.pressure.size();
        effects.pressure.conservativeResize(before + each.faces.cols());
        effects.pressure.tail(each.faces.cols()).setConstant(each.pressure);
    }
}

void gather_membranes(const std::vector<Membrane>& membranes, const RestState& rest, SurfaceEffects& effects) {
    for (const Membrane& each : membranes) {
        require_faces(each.faces, rest, "a membrane");
        require_positive(each.shear_modulus, "the shear modulus of a membrane (kPa)");
        require_positive(each.thickness, "the thickness of a membrane (mm)");
        const Eigen::Index before = effects.membrane_faces.cols();
        append(effects.membrane_faces, each.faces);
        effects.membrane_rest.conservativeResize(3, before + each.faces.cols());
        effects.membrane_stiffness.conservativeResize(before + each.faces.cols());
        for (Eigen::Index f = 0; f < each.faces.cols(); ++f) {
            const Vector3d first = rest.position.col(each.faces(1, f)) - rest.position.col(each.faces(0, f));
            const Vector3d second = rest.position.col(each.faces(2, f)) - rest.position.col(each.faces(0, f));
            // D = [[a, b], [0, c]] in the plane of the face, first axis along `first`.
            const double a = first.norm(), b = first.dot(second) / a, c = first.cross(second).norm() / a;
            effects.membrane_rest.col(before + f) << 1 / a, -b / (a * c), 1 / c;
            effects.membrane_stiffness[before + f] = each.shear_modulus * each.thickness * 0.5 * a * c;
        }
    }
}

void require_pairs(const std::vector<SlidingPair>& pairs, const RestState& rest) {
    for (const SlidingPair& pair : pairs) {
        require_node(pair.first, rest, "a sliding pair");
        require_node(pair.second, rest, "a sliding pair");
        if (pair.first == pair.second)
            throw InvalidInput("a sliding pair joins node " + std::to_string(pair.first) + " with itself");
        require_positive(pair.stiffness, "the stiffness of a sliding pair (mN/mm)");
        if (!(std::abs(pair.normal.norm() - 1) < 1e-6))
            throw InvalidInput("the normal of the sliding pair at node " + std::to_string(pair.first) +
                               " is not a unit vector");
    }
}

/// Entries of every node of `node`, from `corners` nodes of each item.
template <class Corner>
Incidence incidence_of(const std::vector<int>& node, int items, int corners, const Corner& corner) {
    const auto place = [&](int n) {
        return static_cast<std::size_t>(std::lower_bound(node.begin(), node.end(), n) - node.begin());
    };
    Incidence incidence;
    incidence.offset.assign(node.size() + 1, 0);
    for (int i = 0; i < items; ++i)
        for (int c = 0; c < corners; ++c) ++incidence.offset[place(corner(i, c)) + 1];
    for (std::size_t n = 0; n < node.size(); ++n) incidence.offset[n + 1] += incidence.offset[n];
    std::vector<int> next(incidence.offset.begin(), incidence.offset.end() - 1);
    incidence.entry.resize(static_cast<std::size_t>(items) * static_cast<std::size_t>(corners));
    for (int i = 0; i < items; ++i)
        for (int c = 0; c < corners; ++c)
            incidence.entry[static_cast<std::size_t>(next[place(corner(i, c))]++)] = corners * i + c;
    return incidence;
}

void list_by_node(SurfaceEffects& effects) {
    std::vector<int>& node = effects.node;
    for (const Matrix3Xi* faces : {&effects.pressure_faces, &effects.membrane_faces})
        node.insert(node.end(), faces->reshaped().begin(), faces->reshaped().end());
    for (const std::vector<SlidingPair>* pairs : {&effects.sliding, &effects.parting})
        for (const SlidingPair& pair : *pairs) node.insert(node.end(), {pair.first, pair.second});
    std::sort(node.begin(), node.end());
    node.erase(std::unique(node.begin(), node.end()), node.end());
    const auto of_faces = [&](const Matrix3Xi& faces) {
        return incidence_of(node, static_cast<int>(faces.cols()), 3, [&](int f, int c) { return faces(c, f); });
    };
    effects.pressure_incidence = of_faces(effects.pressure_faces);
    effects.membrane_incidence = of_faces(effects.membrane_faces);
    const auto of_pairs = [&](const std::vector<SlidingPair>& pairs) {
        return incidence_of(node, static_cast<int>(pairs.size()), 2, [&](int pair, int second) {
            const SlidingPair& each = pairs[static_cast<std::size_t>(pair)];
            return second == 0 ? each.first : each.second;
        });
    };
    effects.sliding_incidence = of_pairs(effects.sliding);
    effects.parting_incidence = of_pairs(effects.parting);
}

/// Shares of the elements' volumes, mm³.
Eigen::VectorXd nodal_volumes(const RestState& rest) {
    Eigen::VectorXd volume = Eigen::VectorXd::Zero(rest.node_count);
    for (int e = 0; e < rest.element_count(); ++e)
        for (const int node : rest.nodes.col(e)) volume[node] += rest.volume[e] / 4;
    return volume;
}

NodalFluid nodal_fluid(const Fluid& fluid, const RestState& rest) {
    require_positive(fluid.density, "the density of a fluid (kg/mm³)");
    require_finite(fluid.level, "the level of a fluid (mm)");
    const double gravity = fluid.gravity.norm();
    require_positive(gravity, "the gravity on a fluid (mm/s²)");
    NodalFluid nodal;
    nodal.up = -fluid.gravity / gravity;
    nodal.level = fluid.level;
    nodal.rest_height = rest.position.transpose() * nodal.up;
    const Eigen::VectorXd volume = nodal_volumes(rest);
    nodal.weight = fluid.density * gravity * volume;
    nodal.column_height =
        volume.unaryExpr([](double v) { return std::cbrt(v); }).cwiseMax(std::numeric_limits<float>::min());
    return nodal;
}

void require_valid(const Obstacle& obstacle) {
    const DistanceGrid& grid = *obstacle.surface;
    if (grid.size.minCoeff() < 4)
        throw InvalidInput("the distance grid of an obstacle has " + std::to_string(grid.size[0]) + " × " +
                           std::to_string(grid.size[1]) + " × " + std::to_string(grid.size[2]) +
                           " samples; cubic convolution needs 4 along each axis");
    if (static_cast<double>(grid.distance.size()) != grid.size.cast<double>().prod())
        throw InvalidInput("the distance grid of an obstacle holds " + std::to_string(grid.distance.size()) +
                           " values for " + std::to_string(grid.size.cast<long>().prod()) + " samples");
    if (!grid.origin.allFinite() || !grid.steps.allFinite() || !(std::abs(grid.steps.determinant()) > 0))
        throw InvalidInput("the distance grid of an obstacle has steps that do not span space");
    if (!obstacle.placement.shift.allFinite()) throw InvalidInput("the shift of an obstacle is not finite");
    const Eigen::Matrix3d& rotation = obstacle.placement.rotation;
    if (!((rotation.transpose() * rotation).isIdentity(1e-6) && rotation.determinant() > 0))
        throw InvalidInput("the rotation of an obstacle is no proper orthogonal matrix");
    if (!obstacle.velocity.of_origin.allFinite() || !obstacle.velocity.spin.allFinite())
        throw InvalidInput("the velocity of an obstacle is not finite");
    if (!std::all_of(grid.distance.begin(), grid.distance.end(), [](float d) { return std::isfinite(d); }))
        throw InvalidInput("the distance grid of an obstacle has a value that is not finite");
    if (!(obstacle.friction >= 0) || !std::isfinite(obstacle.friction))
        throw InvalidInput("the friction of an obstacle is " + std::to_string(obstacle.friction) +
                           "; it must be 0 or more");
}

NodalContact nodal_contact(const RigidContact& contact, const RestState& rest) {
    if (contact.obstacles.empty()) throw InvalidInput("a contact needs an obstacle at least");
    NodalContact nodal;
    for (const Obstacle& obstacle : contact.obstacles) require_valid(obstacle);
    for (const int node : contact.nodes) require_node(node, rest, "a contact");
    nodal.obstacles = contact.obstacles;
    for (const Obstacle& obstacle : contact.obstacles)
        nodal.reach.push_back({detail::interpolation_reach(*obstacle.surface),
                               std::max(detail::interpolation_steepness(*obstacle.surface), 1e-9),
                               detail::tangent_reach(*obstacle.surface, detail::tangent_tolerance_mm)});
    nodal.node = contact.nodes;
    std::sort(nodal.node.begin(), nodal.node.end());
    nodal.node.erase(std::unique(nodal.node.begin(), nodal.node.end()), nodal.node.end());
    nodal.rest_position = rest.position(Eigen::all, nodal.node);
    return nodal;
}

}  // namespace

bool turns(const std::vector<Obstacle>& obstacles) {
    return std::any_of(obstacles.begin(), obstacles.end(),
                       [](const Obstacle& each) { return !each.velocity.spin.isZero(0.0); });
}

NodalEffects nodal_effects(const Effects& effects, const RestState& rest) {
    NodalEffects nodal;
    gather_pressures(effects.pressures, rest, nodal.surface);
    gather_membranes(effects.membranes, rest, nodal.surface);
    for (const std::vector<SlidingPair>* pairs : {&effects.sliding, &effects.parting}) require_pairs(*pairs, rest);
    nodal.surface.sliding = effects.sliding;
    nodal.surface.parting = effects.parting;
    list_by_node(nodal.surface);
    if (effects.fluid) nodal.fluid = nodal_fluid(*effects.fluid, rest);
    if (effects.contact && !effects.contact->nodes.empty()) nodal.contact = nodal_contact(*effects.contact, rest);
    return nodal;
}

SurfaceEffects with_pairs_decided(const SurfaceEffects& effects, const std::vector<bool>& closed) {
    SurfaceEffects decided = effects;
    decided.parting.clear();
    for (std::size_t p = 0; p < effects.parting.size(); ++p)
        if (closed[p]) decided.sliding.push_back(effects.parting[p]);
    decided.node.clear();
    list_by_node(decided);
    return decided;
}

}  // namespace tissuewarp::tled
