#include "simulation/run.hpp"

#include "core/errors.hpp"
#include "simulation/coarse_start.hpp"
#include "simulation/geometry.hpp"
#include "simulation/limits.hpp"
#include "simulation/loads.hpp"
#include "simulation/obstacles.hpp"
#include "tled/contact.hpp"
#include "tled/dynamics.hpp"
#include "tled/engine_choice.hpp"
#include "tled/load_path.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

namespace tissuewarp::simulation {
namespace {

using Eigen::Matrix3Xd;

/// Progress of a part of the run.
class Part final : public Observer {
public:
    Part(Observer& whole, double from, double to) : whole_(whole), from_(from), to_(to) {}
    void progress(std::string_view stage, double fraction) override {
        // Within a frame an equilibrium does not know how far it has come.
        if (stage == "dynamics") whole_.progress("simulation", from_ + (to_ - from_) * fraction);
    }
    void note(std::string_view message) override { whole_.note(message); }
    bool cancel_requested() override { return whole_.cancel_requested(); }

private:
    Observer& whole_;
    double from_, to_;
};

double seconds_since(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

class Run {
public:
    Run(const BuiltScene& built, const MakeEngine& make_engine, const std::function<void(const Frame&)>& on_frame,
        Observer& observer)
        : built_(built),
          solve_(built.scene.solve),
          make_engine_(make_engine),
          on_frame_(on_frame),
          observer_(observer) {}

    RunSummary run() {
        const auto start = std::chrono::steady_clock::now();
        state_.displacement.setZero(3, built_.stages.front().rest.node_count);
        state_.velocity = state_.displacement;
        show(0, 0.0, 0, state_.displacement);
        for (std::size_t s = 0; s < built_.stages.size(); ++s) {
            if (s > 0) carry_over(s);
            const bool last = s + 1 == built_.stages.size();
            const double end = last ? solve_.duration : built_.stages[s + 1].begin;
            if (solve_.kind == Solve::Kind::Equilibrium)
                equilibria(s, end);
            else if (end > state_.time)
                move(s, end);
        }
        summary_.frames = shown_;
        summary_.seconds = seconds_since(start) - seconds_of_caller_;
        return summary_;
    }

private:
    [[nodiscard]] double time_of(int frame) const { return solve_.duration * frame / solve_.frames; }

    void show(int index, double time, std::size_t stage, const Matrix3Xd& displacement) {
        require_seen_contacts(built_.stages[stage], time, displacement);
        summary_.largest_displacement = displacement.colwise().norm().maxCoeff();
        const auto start = std::chrono::steady_clock::now();
        on_frame_({index, time, static_cast<int>(stage), displacement});
        seconds_of_caller_ += seconds_since(start);
        shown_ = index + 1;
        observer_.checkpoint("simulation", time / solve_.duration);
    }

    /// Bodies are sampled about where the tissue was expected: what went farther must not be in them or beyond them.
    void require_seen_contacts(const Stage& stage, double time, const Matrix3Xd& displacement) const {
        if (!built_.effects.contact) return;
        const tled::RigidContact contact = *conditions_at(built_, stage, time).effects.contact;
        const Matrix3Xd rest = stage.rest.position(Eigen::all, contact.nodes),
                        places = rest + displacement(Eigen::all, contact.nodes);
        for (std::size_t c = 0; c < contact.obstacles.size(); ++c) {
            const int lost =
                passed_unseen(built_.scene.contacts[c], contact.obstacles[c], rest, places, label_volume(built_.scene));
            if (lost > 0)
                throw SolverFailure(
                    "at t = " + std::to_string(time) + " s: " + std::to_string(lost) +
                    " nodes have passed into or through the body of contact " + std::to_string(c + 1) +
                    " where it is not sampled, which is a quarter of the tissue's extent about it; hold "
                    "the tissue, or bring it nearer to the body");
        }
    }

    /// What is left starts from where it was.
    void carry_over(std::size_t stage) {
        const Stage &before = built_.stages[stage - 1], &now = built_.stages[stage];
        std::vector<int> from;
        for (const int node : now.node) from.push_back(before.place[static_cast<std::size_t>(node)]);
        state_.displacement = Matrix3Xd(state_.displacement(Eigen::all, from));
        state_.velocity = Matrix3Xd(state_.velocity(Eigen::all, from));
        if (solve_.kind == Solve::Kind::Dynamics && !now.rest.viscosity.empty())
            observer_.note("after a resection viscous stresses begin anew");
    }

    /// Frames before `end`; at the end of the scene the last one too.
    void equilibria(std::size_t s, double end) {
        const Stage& stage = built_.stages[s];
        const bool last = s + 1 == built_.stages.size();
        if (shown_ > solve_.frames || (!last && time_of(shown_) >= end)) return;
        LoadsInTime loads(built_, stage, stage.begin);
        const tled::RestStiffness stiffness(stage.rest, loads.at(time_of(shown_)));
        const auto engine = make_engine_(stage.rest);
        summary_.engine = engine->description();
        for (; shown_ <= solve_.frames && (last || time_of(shown_) < end);) {
            const double time = time_of(shown_);
            for (const double then : times_of_turning(time_of(shown_ - 1), time))
                equilibrium_at(*engine, stiffness, stage, loads.at(then), then);
            show(shown_, time, s, state_.displacement);
        }
    }

    /// Equilibria are found along straight ways, which what is turned does not go: `end`, and before it as many times
    /// as leave no more than 10° between two.
    [[nodiscard]] std::vector<double> times_of_turning(double begin, double end) const {
        constexpr double most = 10 * std::numbers::pi / 180;
        double angle = 0;
        const auto part = [&](const Curve& curve, double time) { return value_at(curve, time, solve_.duration); };
        for (const Motion& each : built_.scene.motions)
            angle =
                std::max(angle, std::abs(part(each.curve, end) - part(each.curve, begin)) * each.motion.turn.norm());
        const int steps = std::max(1, static_cast<int>(std::ceil(angle / most - 1e-9)));
        std::vector<double> times;
        for (int step = 1; step < steps; ++step) times.push_back(begin + (end - begin) * step / steps);
        times.push_back(end);
        return times;
    }

    void equilibrium_at(tled::Engine& engine, const tled::RestStiffness& stiffness, const Stage& stage,
                        const tled::NodalConditions& conditions, double time) {
        tled::EquilibriumOptions options;
        options.tolerance_mm = solve_.tolerance_mm;
        options.rest = &stage.rest;
        options.method = solve_.method;
        // The first comes from rest, along its load where that is too much at once.
        const Matrix3Xd* start = from_rest_ ? nullptr : &state_.displacement;
        Part part(observer_, time / solve_.duration, time / solve_.duration);
        const bool unilateral = conditions.effects.contact || !conditions.effects.surface.parting.empty();
        try {
            const tled::EquilibriumResult found =
                unilateral ? tled::equilibrium_in_contact(engine, stage.rest, conditions, {.equilibrium = options},
                                                          start, part)
                                 .equilibrium
                           : tled::equilibrium_along_load_or_motion(
                                 engine, stiffness, conditions,
                                 {.equilibrium = options,
                                  .first_parts = solve_.load_steps,
                                  .coarse_start = [&] { return coarse_start(built_, time, part); }},
                                 start, part);
            state_.displacement = found.displacement;
            from_rest_ = false;
            summary_.steps += found.force_evaluations;
            summary_.estimated_error_mm = std::max(summary_.estimated_error_mm, found.estimated_error_mm);
            summary_.min_jacobian = std::min(summary_.min_jacobian, found.min_jacobian);
        } catch (const SolverFailure& failure) {
            throw SolverFailure("at t = " + std::to_string(time) + " s: " + failure.what());
        }
    }

    void move(std::size_t s, double end) {
        const Stage& stage = built_.stages[s];
        LoadsInTime loads(built_, stage, stage.begin);
        const auto engine = make_engine_(stage.rest);
        summary_.engine = engine->description();
        const Matrix3Xd mass = stage.rest.lumped_mass.transpose().replicate(3, 1);
        const bool last = s + 1 == built_.stages.size();
        tled::DynamicsOptions options;
        options.damping = solve_.damping;
        options.step = solve_.step;
        for (int frame = shown_; frame <= solve_.frames; ++frame) options.stops.push_back(time_of(frame));
        options.watch = [&](const tled::DynamicsState& state, const tled::EnergyBalance&) {
            // A frame at the moment of a resection shows what is left.
            if (!last && state.time >= end - 1e-9 * solve_.duration) return;
            if (shown_ <= solve_.frames && state.time >= time_of(shown_) - 1e-9 * solve_.duration)
                show(shown_, time_of(shown_), s, state.displacement);
        };
        Part part(observer_, stage.begin / solve_.duration, end / solve_.duration);
        const double interval = hold_interval(built_, stage);
        const tled::ChangingConditions changing{
            [&](double time) -> const tled::NodalConditions& { return loads.at(time); },
            interval < solve_.duration ? interval : 0};
        const tled::DynamicsResult result =
            tled::dynamics(*engine, stage.rest, mass, changing, state_, end - state_.time, options, part);
        state_ = result.state;
        state_.time = end;
        summary_.steps += result.steps;
        summary_.time_step = result.step;
        summary_.min_jacobian = std::min(summary_.min_jacobian, result.min_jacobian);
        if (last || shown_ > solve_.frames || time_of(shown_) > end + 1e-9 * solve_.duration) return;
        std::vector<int> from;
        for (const int node : built_.stages[s + 1].node) from.push_back(stage.place[static_cast<std::size_t>(node)]);
        show(shown_, time_of(shown_), s + 1, Matrix3Xd(state_.displacement(Eigen::all, from)));
    }

    const BuiltScene& built_;
    const Solve& solve_;
    const MakeEngine& make_engine_;
    const std::function<void(const Frame&)>& on_frame_;
    Observer& observer_;
    tled::DynamicsState state_;
    bool from_rest_ = true;  // no equilibrium has been found yet
    int shown_ = 0;
    double seconds_of_caller_ = 0;
    RunSummary summary_;
};

}  // namespace

std::unique_ptr<tled::Engine> engine_for(const Solve& solve, const tled::RestState& rest, Observer& observer) {
    const bool precise = solve.precision == tled::Scalar::Float64;
    if (precise && solve.device == Device::Gpu)
        throw InvalidInput("forces in float64 are computed on the CPU; take precision = \"float32\" or another device");
    if (solve.device == Device::Gpu) return tled::make_gpu_engine(rest, solve.gpu_index);
    if (solve.device == Device::Cpu || precise) return tled::make_cpu_engine(rest, solve.precision);
    return tled::make_suitable_engine(rest, solve.gpu_index, observer);
}

RunSummary simulate(const BuiltScene& built, const std::function<void(const Frame&)>& on_frame, Observer& observer) {
    const auto as_asked = [&](const tled::RestState& rest) { return engine_for(built.scene.solve, rest, observer); };
    return simulate(built, as_asked, on_frame, observer);
}

RunSummary simulate(const BuiltScene& built, const MakeEngine& make_engine,
                    const std::function<void(const Frame&)>& on_frame, Observer& observer) {
    require_supported(built.scene);
    return Run(built, make_engine, on_frame, observer).run();
}

Matrix3Xd on_scene_mesh(const BuiltScene& built, const Frame& frame) {
    const Stage& stage = built.stages[static_cast<std::size_t>(frame.stage)];
    Matrix3Xd all = Matrix3Xd::Constant(3, built.mesh.node_count(), std::numeric_limits<double>::quiet_NaN());
    all(Eigen::all, stage.node) = frame.displacement;
    return all;
}

Matrix3Xd probe_displacements(const BuiltScene& built, const Frame& frame) {
    const Stage& stage = built.stages[static_cast<std::size_t>(frame.stage)];
    const Matrix3Xd all = on_scene_mesh(built, frame);
    Matrix3Xd probes(3, static_cast<Eigen::Index>(built.probes.size()));
    for (std::size_t p = 0; p < built.probes.size(); ++p) {
        const bool there = std::binary_search(stage.tet.begin(), stage.tet.end(), built.probes[p].tet);
        probes.col(static_cast<Eigen::Index>(p)) =
            there ? Eigen::Vector3d(meshing::interpolate(built.mesh, all, built.probes[p]))
                  : Eigen::Vector3d(Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
    }
    return probes;
}

}  // namespace tissuewarp::simulation
