#include "tests/verification/transient.hpp"

#include "core/errors.hpp"
#include "meshing/primitives.hpp"
#include "tests/support/folders.hpp"
#include "tled/dynamics.hpp"
#include "tled/stiffness/rest_stiffness.hpp"

#include <nlohmann/json.hpp>

#include <array>
#include <cmath>
#include <fstream>
#include <numbers>

namespace tissuewarp::verification {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;

namespace {

nlohmann::json values_of(const std::string& name) {
    const std::string path = (tissuewarp::test::source_folder() / "data/reference/").string() + name;
    std::ifstream stream(path);
    if (!stream) throw IoError("cannot read " + path + ": run from a complete checkout");
    return nlohmann::json::parse(stream).at("values");
}

constexpr double bar_length = 100, bar_half_width = 10;  // mm

tled::NodalConditions bar_conditions(const tled::Model& model, BarEnd end) {
    tled::Conditions held;
    for (int node = 0; node < model.mesh.node_count(); ++node) {
        const Vector3d X = model.mesh.nodes.col(node);
        const bool base = X.z() == 0, all = base && end == BarEnd::Clamped;
        const std::array<bool, 3> on{X.x() == 0 || all, X.y() == 0 || all, base};
        if (on[0] || on[1] || on[2]) held.prescribed.push_back({node, on, Vector3d::Zero()});
    }
    return tled::nodal_conditions(held, model.mesh.node_count());
}

/// Times at which a sampled signal falls or rises through zero, by straight lines between samples.
std::vector<double> zero_crossings(const std::vector<std::array<double, 2>>& samples) {
    std::vector<double> times;
    for (std::size_t i = 1; i < samples.size(); ++i) {
        const auto [t0, a] = samples[i - 1];
        const auto [t1, b] = samples[i];
        if (a * b < 0) times.push_back(t0 + (t1 - t0) * a / (a - b));
    }
    return times;
}

// The seed's cube with one Prony term.
constexpr double cube_edge = 100;  // mm

tled::Model viscous_cube() {
    tled::Model model;
    model.mesh = meshing::box_mesh(Vector3d::Constant(cube_edge), {2, 2, 2});
    model.materials[1] = tled::NeoHookeanIso{1.007, 49.329 + 2.0 / 3.0 * 1.007};
    model.viscosity[1] = {{{0.5, 0.5}}};
    model.element = tled::Element::T4;
    return model;
}

tled::NodalConditions imposed(const tled::Model& model, const Matrix3d& F) {
    tled::Conditions conditions;
    for (int node = 0; node < model.mesh.node_count(); ++node)
        conditions.prescribed.push_back(
            {node, {true, true, true}, (F - Matrix3d::Identity()) * model.mesh.nodes.col(node)});
    return tled::nodal_conditions(conditions, model.mesh.node_count());
}

Vector3d top_force(const tled::Model& model, tled::Engine& engine) {
    const Matrix3Xd force = engine.internal_force();
    Vector3d sum = Vector3d::Zero();
    for (int node = 0; node < model.mesh.node_count(); ++node)
        if (model.mesh.nodes(2, node) == cube_edge) sum += force.col(node);
    return sum;
}

/// One imposed deformation as a function of time; row 0 or 2 of the force is compared.
Relaxation impose(const std::string& name, const std::string& key, int component, double time_step, double last,
                  const std::function<Matrix3d(double)>& F, const MakeEngine& make_engine) {
    const nlohmann::json values = values_of("p8_viscoelastic.json");
    const tled::Model model = viscous_cube();
    const tled::RestState rest = tled::rest_state(model);
    const auto engine = make_engine(rest);
    engine->set_conditions(imposed(model, F(0)));
    Relaxation result{.name = name};
    int done = 0;
    for (std::size_t i = 0; i < values.at("t").size() && values.at("t")[i].get<double>() <= last; ++i) {
        const double time = values.at("t")[i].get<double>();
        for (const int steps = static_cast<int>(std::lround(time / time_step)); done < steps; ++done) {
            engine->run(1, {.time_step = time_step});
            engine->set_conditions(imposed(model, F((done + 1) * time_step)));
        }
        result.time.push_back(time);
        result.computed.push_back(top_force(model, *engine)[component]);
        result.reference.push_back(1e3 *
                                   values.at(key).at(component == 0 ? "force_x_N" : "force_z_N")[i].get<double>());
    }
    return result;
}

/// Inverse iteration: the shape of the lowest mode, largest node of length 1.
Matrix3Xd lowest_mode(const tled::RestState& rest, const tled::NodalConditions& conditions, const Matrix3Xd& mass,
                      Matrix3Xd shape) {
    const tled::RestStiffness stiffness(rest, conditions);
    for (int iteration = 0; iteration < 4; ++iteration) {
        shape = stiffness.solve(mass.cwiseProduct(shape));
        shape /= shape.colwise().norm().maxCoeff();
    }
    return shape;
}

}  // namespace

double bar_period(double poisson, BarEnd end, tled::Element element, int cells, const MakeEngine& make_engine) {
    tled::Model model;
    model.mesh = meshing::box_mesh({bar_half_width, bar_half_width, bar_length}, {cells, cells, 10 * cells});
    model.materials[1] = tled::neo_hookean_iso(3.0, poisson);
    model.element = element;
    const tled::RestState rest = tled::rest_state(model);
    const auto engine = make_engine(rest);
    const Matrix3Xd mass = rest.lumped_mass.transpose().replicate(3, 1);
    const tled::NodalConditions conditions = bar_conditions(model, end);
    Matrix3Xd shape = Matrix3Xd::Zero(3, rest.node_count);
    shape.row(2) = (model.mesh.nodes.row(2).array() * std::numbers::pi / (2 * bar_length)).sin();
    shape = lowest_mode(rest, conditions, mass, shape);
    tled::DynamicsState state{0.01 * shape, Matrix3Xd::Zero(3, rest.node_count), 0};  // mm: strains of 1e-4
    std::vector<std::array<double, 2>> samples;
    tled::DynamicsOptions options{.steps_per_check = cells < 8 ? 10 : 20};  // some sixty looks a period
    options.watch = [&](const tled::DynamicsState& now, const tled::EnergyBalance&) {
        samples.push_back({now.time, mass.cwiseProduct(shape).cwiseProduct(now.displacement).sum()});
    };
    dynamics(*engine, rest, mass, conditions, state, 0.3, options);
    const std::vector<double> crossings = zero_crossings(samples);
    return crossings.size() < 3 ? 0.0 : crossings[2] - crossings[0];
}

std::vector<BarReference> bar_references() {
    const nlohmann::json values = values_of("p8_bar_vibration.json");
    std::vector<BarReference> result{{0.0, BarEnd::Roller, values.at("A_nu0").at("period_T1").get<double>(), 0.0}};
    for (const auto& [name, value] : values.items()) {
        if (!name.starts_with("B_")) continue;
        result.push_back({value.at("nu").get<double>(), name.starts_with("B_roller") ? BarEnd::Roller : BarEnd::Clamped,
                          value.at("period_T1").get<double>(), value.at("uncertainty").get<double>()});
    }
    return result;
}

std::vector<Relaxation> imposed_relaxation(double time_step, double last, const MakeEngine& make_engine) {
    const auto shear = [](double gamma) {
        Matrix3d F = Matrix3d::Identity();
        F(0, 2) = gamma;
        return F;
    };
    const Matrix3d confined = Vector3d(1, 1, 0.9).asDiagonal();
    return {impose(
                "shear step", "a_shear_step", 0, time_step, last, [&](double) { return shear(0.2); }, make_engine),
            impose(
                "confined step", "b_confined_step", 2, time_step, last, [&](double) { return confined; }, make_engine),
            impose(
                "shear ramp", "d_shear_ramp", 0, time_step, last,
                [&](double t) { return shear(0.2 * std::min(1.0, t / 0.1)); }, make_engine)};
}

Relaxation uniaxial_relaxation(double last, const MakeEngine& make_engine) {
    const nlohmann::json values = values_of("p8_viscoelastic.json");
    tled::Model model = viscous_cube();
    model.density = 1e-10;
    const tled::RestState rest = tled::rest_state(model);
    tled::Conditions ends;
    for (int node = 0; node < rest.node_count; ++node) {
        const Vector3d X = model.mesh.nodes.col(node);
        const bool top = X.z() == cube_edge;
        const std::array<bool, 3> on{X.x() == 0, X.y() == 0, X.z() == 0 || top};
        ends.prescribed.push_back({node, on, {0, 0, top ? 0.2 * cube_edge : 0}});
    }
    const auto engine = make_engine(rest);
    const Matrix3Xd mass = rest.lumped_mass.transpose().replicate(3, 1);
    const double lateral = values.at("c_uniaxial_step").at("lateral_stretch")[0].get<double>();
    tled::DynamicsState state{Matrix3Xd::Zero(3, rest.node_count), Matrix3Xd::Zero(3, rest.node_count), 0};
    state.displacement = Vector3d(lateral - 1, lateral - 1, 0.2).asDiagonal() * model.mesh.nodes;
    Relaxation result{.name = "uniaxial step"};
    const std::vector<double> times = values.at("t").get<std::vector<double>>();
    std::size_t next = 1;
    tled::DynamicsOptions options{.damping = 2000, .steps_per_check = 20};
    double last_time = 0, last_force = 0;
    options.watch = [&](const tled::DynamicsState& now, const tled::EnergyBalance&) {
        const double force = top_force(model, *engine).z();
        for (; next < times.size() && now.time >= times[next]; ++next) {
            const double part = (times[next] - last_time) / (now.time - last_time);
            result.time.push_back(times[next]);
            result.computed.push_back(last_force + part * (force - last_force));
            result.reference.push_back(1e3 * values.at("c_uniaxial_step").at("force_z_N")[next].get<double>());
        }
        last_time = now.time;
        last_force = force;
    };
    dynamics(*engine, rest, mass, tled::nodal_conditions(ends, rest.node_count), state, last, options);
    return result;
}

}  // namespace tissuewarp::verification
