#include "simulation/loads.hpp"

#include "simulation/obstacles.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace tissuewarp::simulation {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

namespace {

Vector3d across(const Vector3d& direction) {
    const Vector3d axis = std::abs(direction.z()) < 0.9 ? Vector3d::UnitZ() : Vector3d::UnitY();
    return (axis - axis.dot(direction) * direction).normalized();
}

double part(const Curve& curve, const BuiltScene& built, double time) {
    return value_at(curve, time, built.scene.solve.duration);
}

Vector3d displacement_of(const HeldNode& held, const BuiltScene& built, double time) {
    Vector3d displacement = Vector3d::Zero();
    for (int axis = 0; axis < 3; ++axis) {
        const int motion = held.motion[static_cast<std::size_t>(axis)];
        if (motion < 0) continue;
        const Motion& each = built.scene.motions[static_cast<std::size_t>(motion)];
        displacement[axis] =
            displacement_at(each.motion, part(each.curve, built, time), built.mesh.nodes.col(held.node))[axis];
    }
    return displacement;
}

std::optional<tled::Fluid> fluid_of(const BuiltScene& built, double level, const Vector3d& gravity) {
    if (!built.scene.fluid) return std::nullopt;
    return tled::Fluid{built.scene.fluid->density, gravity, level};
}

double level_at(const FluidLevel& fluid, const BuiltScene& built, double time) {
    return fluid.from + part(fluid.curve, built, time) * (fluid.to - fluid.from);
}

/// mm/s²
Vector3d gravity_of(const BuiltScene& built, double time) {
    if (!built.scene.gravity) return Vector3d::Zero();
    return gravity_at(*built.scene.gravity, time, built.scene.solve.duration);
}

/// Weight and lift that the image was taken under, mN.
Matrix3Xd image_load(const BuiltScene& built, const Stage& stage) {
    Matrix3Xd load = Matrix3Xd::Zero(3, stage.rest.node_count);
    if (!built.scene.gravity || !built.scene.gravity->from) return load;
    const Vector3d gravity = built.scene.gravity->magnitude * *built.scene.gravity->from;
    load = gravity * stage.rest.lumped_mass.transpose();
    if (!built.scene.fluid) return load;
    tled::Effects effects;
    effects.fluid = fluid_of(built, built.scene.fluid->from, gravity);
    return load + tled::fluid_force(*tled::nodal_effects(effects, stage.rest).fluid, Matrix3Xd::Zero(3, load.cols()));
}

/// Weight on every node at a time, less what the image shows, mN.
Matrix3Xd weight_at(const BuiltScene& built, const Stage& stage, const Matrix3Xd& image_load, double time) {
    if (!built.scene.gravity) return -image_load;
    return gravity_of(built, time) * stage.rest.lumped_mass.transpose() - image_load;
}

/// Faces that a tetrahedron of the stage still has, in the stage's nodes.
Eigen::Matrix3Xi remaining_faces(const Eigen::Matrix3Xi& faces, const Stage& stage) {
    if (stage.node.size() == stage.place.size()) return faces;
    const std::vector<meshing::InterfaceFace> owned = meshing::interface_faces(stage.model.mesh);
    const auto sorted = [](std::array<int, 3> nodes) {
        std::sort(nodes.begin(), nodes.end());
        return nodes;
    };
    std::vector<std::array<int, 3>> left;
    for (const meshing::InterfaceFace& face : owned) left.push_back(sorted(face.nodes));
    std::sort(left.begin(), left.end());
    std::vector<Eigen::Vector3i> kept;
    for (Eigen::Index f = 0; f < faces.cols(); ++f) {
        std::array<int, 3> nodes;
        for (int c = 0; c < 3; ++c)
            nodes[static_cast<std::size_t>(c)] = stage.place[static_cast<std::size_t>(faces(c, f))];
        if (std::binary_search(left.begin(), left.end(), sorted(nodes)))
            kept.emplace_back(nodes[0], nodes[1], nodes[2]);
    }
    Eigen::Matrix3Xi matrix(3, static_cast<Eigen::Index>(kept.size()));
    for (std::size_t f = 0; f < kept.size(); ++f) matrix.col(static_cast<Eigen::Index>(f)) = kept[f];
    return matrix;
}

/// What each traction pulls at the nodes where its curve is 1, mN.
std::vector<Matrix3Xd> traction_loads(const BuiltScene& built, const Stage& stage) {
    std::vector<Matrix3Xd> loads;
    for (std::size_t t = 0; t < built.traction_faces.size(); ++t) {
        const Eigen::VectorXd area = nodal_areas(stage.model.mesh, remaining_faces(built.traction_faces[t], stage));
        loads.emplace_back(built.scene.tractions[t].traction * area.transpose());
    }
    return loads;
}

std::vector<double> traction_parts(const BuiltScene& built, double time) {
    std::vector<double> parts;
    for (const Traction& each : built.scene.tractions) parts.push_back(part(each.curve, built, time));
    return parts;
}

void add_tractions(const std::vector<Matrix3Xd>& loads, const std::vector<double>& parts, Matrix3Xd& force) {
    for (std::size_t t = 0; t < loads.size(); ++t) force += parts[t] * loads[t];
}

/// The effects of the scene on what the stage still has, at rest.
tled::Effects remaining_effects(const BuiltScene& built, const Stage& stage) {
    tled::Effects effects = built.effects;
    const auto place = [&](int node) { return stage.place[static_cast<std::size_t>(node)]; };
    for (tled::SurfacePressure& each : effects.pressures) each.faces = remaining_faces(each.faces, stage);
    for (tled::Membrane& each : effects.membranes) each.faces = remaining_faces(each.faces, stage);
    for (std::vector<tled::SlidingPair>* pairs : {&effects.sliding, &effects.parting}) {
        std::erase_if(*pairs,
                      [&](const tled::SlidingPair& pair) { return place(pair.first) < 0 || place(pair.second) < 0; });
        for (tled::SlidingPair& pair : *pairs) {
            pair.first = place(pair.first);
            pair.second = place(pair.second);
        }
    }
    if (effects.contact) {
        std::erase_if(effects.contact->nodes, [&](int node) { return place(node) < 0; });
        for (int& node : effects.contact->nodes) node = place(node);
    }
    effects.pressures.insert(effects.pressures.end(), stage.growth.begin(), stage.growth.end());
    return effects;
}

/// kPa, of the scene's pressures and then of what grows, which does so over the whole scene.
double pressure_at(const BuiltScene& built, const Stage& stage, std::size_t index, double time) {
    const std::vector<Pressure>& stated = built.scene.pressures;
    if (index >= stated.size()) return part({}, built, time) * stage.growth[index - stated.size()].pressure;
    return part(stated[index].curve, built, time) * stated[index].pressure;
}

void move_bodies(const BuiltScene& built, double time, std::vector<tled::Obstacle>& obstacles) {
    for (std::size_t c = 0; c < obstacles.size(); ++c) {
        const Contact& contact = built.scene.contacts[c];
        const double now = part(contact.curve, built, time);
        const double rate = slope_before(contact.curve, time, built.scene.solve.duration);
        obstacles[c].placement = placement_at(contact.motion, now);
        obstacles[c].velocity = velocity_at(contact.motion, now, rate);
    }
}

void move_effects(const BuiltScene& built, const Stage& stage, double time, tled::Effects& effects) {
    for (std::size_t p = 0; p < effects.pressures.size(); ++p)
        effects.pressures[p].pressure = pressure_at(built, stage, p, time);
    if (built.scene.fluid)
        effects.fluid = fluid_of(built, level_at(*built.scene.fluid, built, time), gravity_of(built, time));
    if (!effects.contact) return;
    move_bodies(built, time, effects.contact->obstacles);
}

}  // namespace

Vector3d gravity_at(const Gravity& gravity, double time, double duration) {
    const double part = value_at(gravity.curve, time, duration);
    if (!gravity.from) return part * gravity.magnitude * gravity.to;
    const Vector3d &from = *gravity.from, &to = gravity.to;
    const double angle = std::atan2(from.cross(to).norm(), from.dot(to));
    if (!(angle > 0)) return gravity.magnitude * to;
    const bool opposite = from.cross(to).norm() < 1e-9;
    const Vector3d axis = opposite ? across(from) : Vector3d(from.cross(to).normalized());
    return gravity.magnitude * (Eigen::AngleAxisd(part * angle, axis) * from);
}

tled::Conditions conditions_at(const BuiltScene& built, const Stage& stage, double time) {
    tled::Conditions conditions;
    for (const HeldNode& held : built.held) {
        const int node = stage.place[static_cast<std::size_t>(held.node)];
        if (node < 0) continue;
        tled::PrescribedDisplacement prescribed;
        prescribed.node = node;
        for (std::size_t axis = 0; axis < 3; ++axis) prescribed.constrained[axis] = held.motion[axis] != HeldNode::none;
        prescribed.displacement = displacement_of(held, built, time);
        conditions.prescribed.push_back(prescribed);
    }
    for (tled::Spring spring : built.springs) {
        spring.node = stage.place[static_cast<std::size_t>(spring.node)];
        if (spring.node >= 0) conditions.springs.push_back(spring);
    }
    conditions.external_force = weight_at(built, stage, image_load(built, stage), time);
    add_tractions(traction_loads(built, stage), traction_parts(built, time), conditions.external_force);
    conditions.effects = remaining_effects(built, stage);
    move_effects(built, stage, time, conditions.effects);
    return conditions;
}

LoadsInTime::LoadsInTime(const BuiltScene& built, const Stage& stage, double time)
    : built_(built),
      stage_(stage),
      image_load_(image_load(built, stage)),
      traction_loads_(traction_loads(built, stage)),
      traction_parts_(traction_parts(built, time)) {
    const tled::Conditions conditions = conditions_at(built, stage, time);
    for (const tled::SurfacePressure& each : conditions.effects.pressures) pressure_faces_.push_back(each.faces.cols());
    conditions_ = tled::nodal_conditions(conditions, stage.rest);
    gravity_ = gravity_of(built, time);
}

void LoadsInTime::change_dead_loads(double time) {
    const Vector3d gravity = gravity_of(built_, time);
    std::vector<double> parts = traction_parts(built_, time);
    if (gravity == gravity_ && parts == traction_parts_) return;
    gravity_ = gravity;
    traction_parts_ = std::move(parts);
    conditions_.external_force = weight_at(built_, stage_, image_load_, time);
    add_tractions(traction_loads_, traction_parts_, conditions_.external_force);
    if (!conditions_.effects.fluid) return;
    tled::Effects fluid;
    fluid.fluid = fluid_of(built_, level_at(*built_.scene.fluid, built_, time), gravity);
    conditions_.effects.fluid = tled::nodal_effects(fluid, stage_.rest).fluid;
}

const tled::NodalConditions& LoadsInTime::at(double time) {
    for (const HeldNode& held : built_.held) {
        const int node = stage_.place[static_cast<std::size_t>(held.node)];
        if (node >= 0) conditions_.imposed.col(node) = displacement_of(held, built_, time);
    }
    change_dead_loads(time);
    tled::NodalEffects& effects = conditions_.effects;
    if (effects.fluid) effects.fluid->level = level_at(*built_.scene.fluid, built_, time);
    if (effects.contact) move_bodies(built_, time, effects.contact->obstacles);
    Eigen::Index face = 0;
    for (std::size_t p = 0; p < pressure_faces_.size(); ++p) {
        effects.surface.pressure.segment(face, pressure_faces_[p]).setConstant(pressure_at(built_, stage_, p, time));
        face += pressure_faces_[p];
    }
    return conditions_;
}

double hold_interval(const BuiltScene& built, const Stage& stage) {
    const Scene& scene = built.scene;
    const double duration = scene.solve.duration;
    constexpr double small = 0.01;
    double shortest = std::numeric_limits<double>::infinity();
    const meshing::TetMesh& mesh = stage.model.mesh;
    for (int e = 0; e < mesh.tet_count(); ++e)
        for (int a = 0; a < 4; ++a)
            for (int b = 0; b < a; ++b)
                shortest =
                    std::min(shortest, (mesh.nodes.col(mesh.tets(a, e)) - mesh.nodes.col(mesh.tets(b, e))).norm());
    double interval = duration;
    constexpr int fewest = 20;  // of what changes by next to nothing
    const auto limit = [&](double most, double speed) {
        if (speed > 0) interval = std::min({interval, most / speed, duration / fewest});
    };
    for (const HeldNode& held : built.held)
        for (const int m : held.motion) {
            if (m < 0) continue;
            const Motion& each = scene.motions[static_cast<std::size_t>(m)];
            const double reach = distance_from_axis(each.motion, built.mesh.nodes.col(held.node));
            limit(small * shortest, longest_way(each.motion, reach) * steepest(each.curve, duration));
        }
    for (std::size_t c = 0; c < scene.contacts.size(); ++c) {
        const RigidMotion& motion = scene.contacts[c].motion;
        const double reach = surface_reach(*built.effects.contact->obstacles[c].surface, motion);
        limit(small * shortest, longest_way(motion, reach) * steepest(scene.contacts[c].curve, duration));
    }
    if (!stage.growth.empty()) limit(small, 1 / duration);
    for (const Pressure& pressure : scene.pressures) limit(small, steepest(pressure.curve, duration));
    for (const Traction& traction : scene.tractions) limit(small, steepest(traction.curve, duration));
    if (scene.gravity && scene.gravity->from != scene.gravity->to)
        limit(small, steepest(scene.gravity->curve, duration));
    if (scene.fluid && scene.fluid->from != scene.fluid->to) limit(small, steepest(scene.fluid->curve, duration));
    return interval;
}

}  // namespace tissuewarp::simulation
