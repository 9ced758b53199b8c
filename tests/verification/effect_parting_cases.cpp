// Surfaces that touch, press and slide on one another and may part.
#include "tests/verification/effect_cases.hpp"
#include "tests/verification/effect_column.hpp"
#include "tests/verification/effect_scene_end.hpp"

#include "meshing/primitives.hpp"
#include "simulation/build.hpp"
#include "simulation/run.hpp"
#include "tled/dynamics.hpp"
#include "tled/model/internal_force.hpp"
#include "tled/nodal_effects.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

namespace tissuewarp::verification {
namespace {

using namespace effects;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using simulation::BuiltScene;
using simulation::Curve;
using simulation::HalfSpace;
using simulation::Scene;
using simulation::Sliding;

/// A box in two halves along z, "lower" and "upper", that may part; the base stands.
Scene two_blocks(const Vector3d& size, const std::array<int, 3>& cells, double stiffness) {
    Scene scene;
    scene.title = "two blocks";
    scene.geometry = simulation::BoxGeometry{Vector3d::Zero(), size, cells};
    scene.tissues[1].material = tled::neo_hookean_iso(modulus, poisson);
    scene.density = density;
    scene.sets["all"] = {};
    scene.sets["base"].side = simulation::Side{2, false, 0.0};
    scene.sets["top"].side = simulation::Side{2, true, 0.0};
    scene.sets["lower"].half_space = HalfSpace{{0, 0, size.z() / 2}, {0, 0, 1}};
    scene.sets["upper"].half_space = HalfSpace{{0, 0, size.z() / 2}, {0, 0, -1}};
    Sliding sliding;
    sliding.sets = {"lower", "upper"};
    sliding.opening = Sliding::Opening::Free;
    sliding.per_area = stiffness;
    scene.sliding.push_back(sliding);
    scene.solve.element = tled::Element::T4;
    scene.solve.tolerance_mm = 1e-3;
    return scene;
}

/// A factor asks that each piece be held, which pairs do not do.
void hold_weakly(const std::string& set, Scene& scene) {
    scene.springs.push_back({set, 0.0, 1e-5, simulation::Springs::Along::AllDirections});
}

// Two halves of the column that are pressed: one column, less the overlap p/k that carries the pressure.
constexpr double press = 1.0, press_stiffness = 100.0;  // kPa, kPa/mm
double pressed_shift() {
    return (column_stretch(-press) - 1) * length - press / press_stiffness;
}
double measured_pressed_shift(const MakeEngine& make) {
    Scene scene = two_blocks({side, side, length}, {1, 1, 50}, press_stiffness);
    scene.fixed.push_back({"all", {true, true, false}});
    scene.fixed.push_back({"base", {false, false, true}});
    hold_weakly("upper", scene);
    scene.pressures.push_back({"top", press, Curve{}});
    const BuiltScene built = simulation::build(scene);
    const Matrix3Xd u = end_of(built, make);
    double sum = 0;
    int count = 0;
    for (int a = 0; a < built.mesh.node_count(); ++a)
        if (on_top(built.mesh.nodes.col(a))) {
            sum += u(2, a);
            ++count;
        }
    return sum / count;
}

// Two blocks pressed by 2 mm and then drawn 3 mm apart and 1 mm aside: each as it was at rest.
double measured_distance_from_apart(const MakeEngine& make) {
    Scene scene = two_blocks({20, 20, 20}, {4, 4, 4}, press_stiffness);
    scene.fixed.push_back({"base", {true, true, true}});
    scene.motions.push_back({"top", {true, true, true}, {{1, 0, 3}}, Curve{{{0, 0}, {0.5, -0.667}, {1, 1}}}});
    scene.solve.frames = 2;
    const BuiltScene built = simulation::build(scene);
    const Matrix3Xd u = end_of(built, make);
    double largest = 0;
    for (int e = 0; e < built.mesh.tet_count(); ++e) {
        const bool upper = built.mesh.nodes(Eigen::all, built.mesh.tets.col(e)).row(2).mean() > 10;
        for (const int a : built.mesh.tets.col(e))
            largest = std::max(largest, (u.col(a) - (upper ? Vector3d(1, 0, 3) : Vector3d(0, 0, 0))).norm());
    }
    return largest;
}

// A block that rests on a slope, held by a wall at its lower side: the slope bears a force along its normal alone, so
// that the wall bears the weight times tan α, whatever the tissue does.
constexpr double slope = 0.5, slope_side = 20.0;
BuiltScene block_on_slope() {
    meshing::TetMesh mesh = meshing::box_mesh({slope_side, slope_side, slope_side}, {4, 4, 4});
    for (int e = 0; e < mesh.tet_count(); ++e)
        mesh.labels[e] = mesh.nodes(Eigen::all, mesh.tets.col(e)).row(2).mean() > slope_side / 2 ? 2 : 1;
    for (auto X : mesh.nodes.colwise())  // the middle plane tilts about y, base and top stay
        X[2] += slope * (X[0] - slope_side / 2) * (1 - std::abs(X[2] - slope_side / 2) / (slope_side / 2));
    Scene scene = two_blocks({1, 1, 1}, {1, 1, 1}, 100.0);
    scene.geometry = mesh;
    scene.tissues[2] = scene.tissues[1];
    scene.sliding.front().sets.reset();
    scene.sliding.front().labels = {1, 2};
    for (const auto& [name, axis] : {std::pair{"wall", 0}, std::pair{"front", 1}}) {
        scene.sets[name].side = simulation::Side{axis, false, 0.0};
        scene.sets[name].label = 2;
        scene.fixed.push_back({name, {axis == 0, axis == 1, false}});
    }
    scene.fixed.push_back({"base", {true, true, true}});
    scene.sets["upper"] = {};
    scene.sets["upper"].label = 2;
    hold_weakly("upper", scene);
    scene.gravity = simulation::Gravity{std::nullopt, {0, 0, -1}, gravity, Curve{{{0, 1}}}};
    return simulation::build(scene);
}
double measured_wall_over_weight(const MakeEngine& make) {
    const BuiltScene built = block_on_slope();
    const Matrix3Xd u = end_of(built, make);
    const tled::RestState& rest = built.stages.front().rest;
    Eigen::VectorXd upper = Eigen::VectorXd::Zero(rest.node_count);
    for (int e = 0; e < built.mesh.tet_count(); ++e)
        if (built.mesh.labels[e] == 2)
            for (const int a : built.mesh.tets.col(e)) upper[a] = 1;
    tled::Effects pairs;
    pairs.parting = built.effects.parting;
    const Matrix3Xd reaction =
        tled::internal_force(rest, u) - tled::surface_force(tled::nodal_effects(pairs, rest).surface, rest.position, u);
    double wall = 0;
    for (int a = 0; a < rest.node_count; ++a)
        if (upper[a] == 1 && rest.position(0, a) < 1e-9) wall += reaction(0, a);
    return wall / (gravity * upper.dot(rest.lumped_mass));
}

// A bar that meets another at rest, end to end: after two travels of the wave they part, and the other has all of the
// velocity. Bars that held together would swing on.
constexpr double hit_velocity = 5.0;
double measured_velocity_of_other(const MakeEngine& make) {
    Scene scene = two_blocks({side, side, 2 * length}, {1, 1, 100}, 50.0);
    scene.fixed.push_back({"all", {true, true, false}});
    const BuiltScene built = simulation::build(scene);
    const simulation::Stage& stage = built.stages.front();
    tled::Conditions conditions;
    guide(stage.model, false, conditions);
    conditions.effects.parting = built.effects.parting;
    tled::DynamicsState state{Matrix3Xd::Zero(3, stage.rest.node_count), Matrix3Xd::Zero(3, stage.rest.node_count), 0};
    Eigen::VectorXd upper = Eigen::VectorXd::Zero(stage.rest.node_count);
    for (int e = 0; e < built.mesh.tet_count(); ++e)
        if (built.mesh.nodes(Eigen::all, built.mesh.tets.col(e)).row(2).mean() > length)
            for (const int a : built.mesh.tets.col(e)) upper[a] = 1;
    state.velocity.row(2) = -hit_velocity * upper.transpose();
    const auto engine = make(stage.rest);
    const Matrix3Xd mass = stage.rest.lumped_mass.transpose().replicate(3, 1);
    const double travel = length / std::sqrt(tled::p_wave_modulus(tled::neo_hookean_iso(modulus, poisson)) / density);
    const Matrix3Xd velocity =
        tled::dynamics(*engine, stage.rest, mass, tled::nodal_conditions(conditions, stage.rest), state, 3 * travel)
            .state.velocity;
    const Eigen::VectorXd mass_below = stage.rest.lumped_mass.cwiseProduct(Eigen::VectorXd(1 - upper.array()));
    return velocity.row(2).dot(mass_below) / mass_below.sum();
}

}  // namespace

std::vector<EffectCase> parting_cases() {
    return {
        {"parting", "two halves of a column, pressed", "shift of the top", "mm", "(λ(−p) − 1) L − p/k", pressed_shift(),
         2e-3, measured_pressed_shift},
        {"parting", "two blocks pressed, then drawn apart", "largest distance from rest", "mm", "no force is left", 0,
         2e-3, measured_distance_from_apart},
        {"parting", "block on a slope, against a wall", "wall over weight", "1", "tan α", slope, 2e-3,
         measured_wall_over_weight},
        {"parting", "bar that hits another", "velocity of the other", "mm/s", "wave of a linear bar", -hit_velocity,
         0.03 * hit_velocity, measured_velocity_of_other},
    };
}

}  // namespace tissuewarp::verification
