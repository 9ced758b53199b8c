// What changes in time, by whole scenes: resection, and motions that follow a curve.
#include "tests/verification/effect_cases.hpp"
#include "tests/verification/effect_column.hpp"
#include "tests/verification/effect_scene_end.hpp"

#include "simulation/build.hpp"
#include "simulation/run.hpp"

#include <Eigen/Geometry>

#include <array>
#include <cmath>

namespace tissuewarp::verification {
namespace {

using namespace effects;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using simulation::BuiltScene;
using simulation::Curve;
using simulation::HalfSpace;
using simulation::Scene;

/// The column of effect_column.hpp, of `cells` along it.
Scene column_scene(int cells) {
    Scene scene;
    scene.title = "column";
    scene.geometry = simulation::BoxGeometry{Vector3d::Zero(), {side, side, length}, {1, 1, cells}};
    scene.tissues[1].material = tled::neo_hookean_iso(modulus, poisson);
    scene.density = density;
    scene.sets["all"] = {};
    scene.sets["base"].side = simulation::Side{2, false, 0.0};
    scene.fixed.push_back({"all", {true, true, false}});
    scene.solve.element = tled::Element::T4;
    return scene;
}

/// z of the mean displacement of the tissue that is left, where it is highest at rest.
double shift_of_top(const Scene& scene, const MakeEngine& make) {
    const BuiltScene built = simulation::build(scene);
    double shift = 0;
    simulation::simulate(built, make, [&](const simulation::Frame& frame) {
        const simulation::Stage& stage = built.stages[static_cast<std::size_t>(frame.stage)];
        const Eigen::RowVectorXd z = stage.rest.position.row(2);
        const Eigen::RowVectorXd on_top = (z.array() > z.maxCoeff() - 1e-9).cast<double>();
        shift = frame.displacement.row(2).dot(on_top) / on_top.sum();
    });
    return shift;
}

// A column under its weight whose upper half is taken away: what is left, from where it was, comes up to the sag of a
// column of half the length.
double measured_sag_after_resection(const MakeEngine& make) {
    Scene scene = column_scene(50);
    scene.fixed.push_back({"base", {false, false, true}});
    scene.gravity = simulation::Gravity{std::nullopt, {0, 0, -1}, gravity, Curve{{{0, 1}}}};
    scene.sets["upper half"].half_space = HalfSpace{{0, 0, length / 2}, {0, 0, -1}};
    scene.resections.push_back({"upper half", 0.75});
    scene.solve.frames = 2;
    scene.solve.tolerance_mm = 1e-3;
    return shift_of_top(scene, make);
}
double sag_of_half() {
    return deformed_length([](double X) { return -density * gravity * (length / 2 - X); }, 0, length / 2) - length / 2;
}

// The base of a bar at rest goes up by d in the time a that a wave takes from end to end, stays for a, and goes back in
// a third. At the free end a wave counts twice, and it comes back with the other sign from the base: u(t) = 2 (d(t − a)
// − d(t − 3 a)), which at 4.5 a is −2 d.
constexpr double stroke = 0.5;  // mm; the strain on the way is half a per cent, so that the bar answers linearly
double travel_time() {
    return length / std::sqrt(tled::p_wave_modulus(tled::neo_hookean_iso(modulus, poisson)) / density);
}
double measured_shift_of_free_end(const MakeEngine& make) {
    const double a = travel_time();
    Scene scene = column_scene(100);
    scene.motions.push_back(
        {"base", {false, false, true}, {{0, 0, stroke}}, Curve{{{0, 0}, {a, 1}, {2 * a, 1}, {3 * a, 0}}}});
    scene.solve.kind = simulation::Solve::Kind::Dynamics;
    scene.solve.duration = 4.5 * a;
    scene.solve.damping = 0;
    return shift_of_top(scene, make);
}

// A stiff block at rest on a table that is drawn away under it: friction gives it μ g until it is as fast as the table.
constexpr double friction = 0.3, table_velocity = 100.0, table_time = 0.06;
Scene block_on_table(double height, const std::array<int, 3>& cells, const simulation::RigidMotion& motion_of_table) {
    Scene scene;
    scene.title = "block";
    scene.geometry = simulation::BoxGeometry{Vector3d::Zero(), {10, 10, height}, cells};
    scene.tissues[1].material = tled::neo_hookean_iso(2000.0, poisson);
    scene.density = density;
    scene.gravity = simulation::Gravity{std::nullopt, {0, 0, -1}, gravity, Curve{{{0, 1}}}};
    simulation::Contact table;
    table.body = HalfSpace{{0, 0, 0}, {0, 0, 1}};
    table.friction = friction;
    table.motion = motion_of_table;
    scene.contacts.push_back(table);
    scene.solve.element = tled::Element::T4;
    scene.solve.kind = simulation::Solve::Kind::Dynamics;
    scene.solve.duration = table_time;
    scene.solve.damping = 0;
    return scene;
}

double measured_drag(const MakeEngine& make) {
    const simulation::RigidMotion motion{{table_velocity * table_time, 0, 0}, {0, 0, 0}, {0, 0, 0}};
    return end_of(simulation::build(block_on_table(4.0, {4, 4, 2}, motion)), make).row(0).mean();
}
double drag() {
    return table_velocity * table_time - table_velocity * table_velocity / (2 * friction * gravity);
}

// A flat block about whose axis the table turns: friction of the nodes below, each with its share of the weight at its
// own radius, spins the block up until it goes round with the table. A higher block rocks, which moves its weight.
constexpr double table_spin = 20.0;  // rad/s
const Vector3d table_centre(5, 5, 0);
BuiltScene block_on_turntable() {
    const simulation::RigidMotion motion{{0, 0, 0}, {0, 0, table_spin * table_time}, table_centre};
    return simulation::build(block_on_table(1.5, {8, 8, 1}, motion));
}
/// Mean angle about the table's centre.
double measured_spin_up(const MakeEngine& make) {
    const BuiltScene built = block_on_turntable();
    const Matrix3Xd X = built.mesh.nodes.colwise() - table_centre, x = X + end_of(built, make);
    return std::atan2((X.row(0).cwiseProduct(x.row(1)) - X.row(1).cwiseProduct(x.row(0))).sum(),
                      X.topRows(2).cwiseProduct(x.topRows(2)).sum());
}
double spin_up() {
    const BuiltScene built = block_on_turntable();
    const tled::RestState& rest = built.stages.front().rest;
    const Matrix3Xd X = rest.position.colwise() - table_centre;
    const Eigen::VectorXd radius = X.topRows(2).colwise().norm();
    Eigen::VectorXd area = Eigen::VectorXd::Zero(rest.node_count);  // of the lower side
    for (const meshing::InterfaceFace& face : meshing::interface_faces(built.mesh)) {
        const auto at = [&](std::size_t corner) -> Vector3d { return X.col(face.nodes[corner]); };
        if (at(0).z() + at(1).z() + at(2).z() > 1e-9) continue;
        for (const int node : face.nodes) area[node] += (at(1) - at(0)).cross(at(2) - at(0)).norm() / 6;
    }
    const double lever = area.dot(radius) / area.sum();
    const double inertia = rest.lumped_mass.dot(radius.cwiseAbs2()) / rest.lumped_mass.sum();
    return table_spin * table_time - table_spin * table_spin * inertia / (2 * friction * gravity * lever);
}

// A block hinged along an edge of its base on a plane that turns about the edge lies on it whatever the angle. Weak
// springs hold it down.
constexpr double plane_angle = 0.6;
double measured_distance_from_plane(const MakeEngine& make) {
    Scene scene;
    scene.title = "hinged block";
    scene.geometry = simulation::BoxGeometry{Vector3d::Zero(), {20, 10, 10}, {4, 2, 2}};
    scene.tissues[1].material = tled::neo_hookean_iso(3.0, poisson);
    scene.sets["all"] = {};
    scene.sets["hinge"].box = simulation::Box{{-1e-3, -1, -1e-3}, {1e-3, 11, 1e-3}};
    scene.fixed.push_back({"hinge", {true, true, true}});
    scene.springs.push_back({"all", 0.0, 1e-4, simulation::Springs::Along::AllDirections});
    simulation::Contact plane;
    plane.body = HalfSpace{{0, 0, 0}, {0, 0, 1}};
    plane.motion = {{0, 0, 0}, {0, -plane_angle, 0}, {0, 0, 0}};
    scene.contacts.push_back(plane);
    scene.solve.element = tled::Element::T4;
    scene.solve.frames = 6;
    scene.solve.tolerance_mm = 1e-3;
    const BuiltScene built = simulation::build(scene);
    const auto [shift, rotation] = simulation::placement_at(scene.contacts.front().motion, 1);
    const Matrix3Xd& X = built.mesh.nodes;
    return (rotation * X - X - end_of(built, make)).colwise().norm().maxCoeff();
}

}  // namespace

std::vector<EffectCase> scene_cases() {
    std::vector<EffectCase> cases{
        {"resection", "column under its weight loses its upper half", "sag of the top", "mm",
         "quadrature, of half the length", sag_of_half(), 0.01, measured_sag_after_resection},
        {"motion in time", "bar whose base goes up and back", "shift of the free end", "mm",
         "2 (d(t − a) − d(t − 3 a))", -2 * stroke, 0.06 * stroke, measured_shift_of_free_end},
        {"moving body", "block on a table that is drawn away", "distance", "mm", "w t − w²/(2 μ g)", drag(), 0.03,
         measured_drag},
        {"turning body", "block on a table that turns about its middle", "angle", "rad", "ω t − ω² I/(2 μ g m r)",
         spin_up(), 5e-3, measured_spin_up},
        {"turning body", "hinged block on a plane that turns by 34°", "largest distance from it", "mm", "rigid", 0,
         0.03, measured_distance_from_plane},
    };
    for (const std::vector<EffectCase>& more : {fibre_cases(), parting_cases()})
        cases.insert(cases.end(), more.begin(), more.end());
    return cases;
}

}  // namespace tissuewarp::verification
