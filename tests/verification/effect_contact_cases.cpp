// Tissue against rigid bodies.
#include "tests/verification/effect_cases.hpp"
#include "tests/verification/effect_column.hpp"

#include "meshing/primitives.hpp"
#include "tled/contact.hpp"
#include "tled/dynamics.hpp"

#include <cmath>

namespace tissuewarp::verification {
namespace {

using namespace effects;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using tled::Conditions;
using tled::Model;
using tled::RestState;

tled::DistanceGrid half_space(double height, double reach) {
    constexpr int samples = 11;
    const double step = 2 * reach / (samples - 1);
    tled::DistanceGrid grid{{-reach, -reach, height - reach}, step * Eigen::Matrix3d::Identity(), {}, {}};
    grid.size.setConstant(samples);
    for (int k = 0; k < samples; ++k)
        grid.distance.insert(grid.distance.end(), samples * samples, static_cast<float>(k * step - reach));
    return grid;
}

tled::RigidContact contact_of_all(const Model& model, double friction, const tled::DistanceGrid& grid) {
    tled::RigidContact contact;
    for (int a = 0; a < model.mesh.node_count(); ++a) contact.nodes.push_back(a);
    contact.obstacles.push_back({grid, {}, friction});
    return contact;
}

tled::DynamicsState moving(const Model& model, const Vector3d& velocity) {
    const Eigen::Index nodes = model.mesh.node_count();
    return {Matrix3Xd::Zero(3, nodes), velocity.replicate(1, nodes), 0};
}

tled::DynamicsResult moved(const Model& model, const Conditions& conditions, const tled::DynamicsState& start,
                           double duration, const MakeEngine& make) {
    const RestState rest = tled::rest_state(model);
    const tled::NodalConditions nodal = tled::nodal_conditions(conditions, rest);
    const auto engine = make(rest);
    const Matrix3Xd mass = rest.lumped_mass.transpose().replicate(3, 1);
    return tled::dynamics(*engine, rest, mass, nodal, start, duration);
}

/// v, mm/s: slow against the waves of 2009 mm/s, so that the bar answers linearly.
constexpr double impact_velocity = 5.0;
/// mN s (kg mm/s) along z of a bar thrown at the wall, `travels` times of a wave from end to end after it has met it.
struct Thrown {
    double time, mass, momentum;
};
Thrown thrown(double travels, const MakeEngine& make) {
    const Model model = column(50);
    Conditions conditions;
    guide(model, false, conditions);
    conditions.effects.contact = contact_of_all(model, 0, half_space(0, 20));
    const auto law = tled::neo_hookean_iso(modulus, poisson);
    const double time = travels * length / std::sqrt(tled::p_wave_modulus(law) / density);
    const auto end = moved(model, conditions, moving(model, {0, 0, -impact_velocity}), time, make).state;
    const Eigen::VectorXd mass = tled::rest_state(model).lumped_mass;
    return {time, mass.sum(), end.velocity.row(2).dot(mass)};
}
/// Velocity of the centre of mass after the wall has let go, which is after two.
double measured_rebound(const MakeEngine& make) {
    const Thrown bar = thrown(3.0, make);
    return bar.momentum / bar.mass;
}
/// Mean stress at the wall while the bar is shortening, by the change of momentum.
double measured_impact_stress(const MakeEngine& make) {
    const Thrown bar = thrown(0.8, make);
    return (bar.momentum + impact_velocity * bar.mass) / (bar.time * side * side);
}
double impact_stress() {
    const double wave_modulus = tled::p_wave_modulus(tled::neo_hookean_iso(modulus, poisson));
    return density * std::sqrt(wave_modulus / density) * impact_velocity;
}

// A stiff block that slides on a table until friction has stopped it: v²/(2 μ g).
constexpr double sliding_velocity = 100.0, friction = 0.3;
double measured_stopping_distance(const MakeEngine& make) {
    Model model;
    model.mesh = meshing::box_mesh({10, 10, 4}, {4, 4, 2});
    model.materials = {{1, tled::neo_hookean_iso(2000.0, poisson)}};
    model.element = tled::Element::T4;
    model.density = density;
    Conditions conditions;
    conditions.external_force = weight(tled::rest_state(model), {0, 0, -gravity});
    conditions.effects.contact = contact_of_all(model, friction, half_space(0, 40));
    const double time = 1.3 * sliding_velocity / (friction * gravity);
    const auto end = moved(model, conditions, moving(model, {sliding_velocity, 0, 0}), time, make).state;
    return end.displacement.row(0).mean();
}

// A column under its weight, hung up by a weak spring, that settles on a table which comes 5 mm up: as gravity on a
// held base, 5 mm higher.
double measured_sag_on_table(const MakeEngine& make) {
    const Model model = column(50);
    const RestState rest = tled::rest_state(model);
    Conditions conditions;
    guide(model, false, conditions);
    conditions.external_force = weight(rest, {0, 0, -gravity});
    for (int a = 0; a < model.mesh.node_count(); ++a)
        conditions.springs.push_back({a, 1e-6 * Eigen::Matrix3d::Identity(), {0, 0, 0}});
    conditions.effects.contact = contact_of_all(model, 0, half_space(5, 20));
    const auto engine = make(rest);
    tled::ContactOptions options;
    options.equilibrium.tolerance_mm = 1e-3;
    options.penetration_mm = 1e-3;
    const Matrix3Xd u = tled::equilibrium_in_contact(*engine, rest, tled::nodal_conditions(conditions, rest), options)
                            .equilibrium.displacement;
    return mean(model, u, 2, on_top);
}

}  // namespace

std::vector<EffectCase> contact_cases() {
    const double sag = sag_of_column();
    return {
        {"contact, static", "column on a table 5 mm higher", "shift of the top", "mm", "sag + 5", sag + 5, 0.02,
         measured_sag_on_table},
        {"contact, dynamic", "bar thrown at a wall", "velocity back", "mm/s", "wave of a linear bar", impact_velocity,
         0.03 * impact_velocity, measured_rebound},
        {"contact, dynamic", "bar thrown at a wall", "stress at the wall", "kPa", "ρ c v", impact_stress(),
         0.03 * impact_stress(), measured_impact_stress},
        {"friction", "block that slides to rest", "distance", "mm", "v²/(2 μ g)",
         sliding_velocity * sliding_velocity / (2 * friction * gravity), 0.03, measured_stopping_distance},
    };
}

}  // namespace tissuewarp::verification
