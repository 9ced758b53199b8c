#pragma once
/// Runs a scene.

#include "simulation/build.hpp"
#include "tled/engine.hpp"

#include <functional>
#include <memory>
#include <string>

namespace tissuewarp::simulation {

/// The tissue at a time. Valid during the call that gets it.
struct Frame {
    int index = 0;                         ///< 0: at rest
    double time = 0;                       ///< s
    int stage = 0;                         ///< index into BuiltScene::stages
    const Eigen::Matrix3Xd& displacement;  ///< 3 × nodes of the stage, mm
};

struct RunSummary {
    int frames = 0;                   ///< the one at rest included
    double largest_displacement = 0;  ///< mm, in the last frame
    double min_jacobian = 1;          ///< det F, of all frames
    double estimated_error_mm = 0;    ///< of equilibria, the largest; 0 in dynamics
    long long steps = 0;              ///< force evaluations
    double time_step = 0;             ///< s, the last one of dynamics
    double seconds = 0;               ///< of the solution, without building and `on_frame`
    std::string engine;
};

/// The engine that a scene asks for, on a stage of it. Throws GpuUnavailable.
std::unique_ptr<tled::Engine> engine_for(const Solve& solve, const tled::RestState& rest, Observer& observer);

/// Calls `on_frame` at rest and at every frame of Scene::solve, in the order of time. An equilibrium starts from the
/// frame before it; after a resection, what is left starts from where it was.
///
/// Throws InvalidInput for what cannot be simulated (limits.hpp) and where nothing holds the tissue, SolverFailure
/// with the time that was reached, GpuUnavailable, Cancelled.
RunSummary simulate(
    const BuiltScene& built, const std::function<void(const Frame&)>& on_frame = [](const Frame&) {},
    Observer& observer = silent_observer());

/// The same on engines of the caller's, one for each stage, whatever Solve::device says.
using MakeEngine = std::function<std::unique_ptr<tled::Engine>(const tled::RestState&)>;
RunSummary simulate(const BuiltScene& built, const MakeEngine& make_engine,
                    const std::function<void(const Frame&)>& on_frame, Observer& observer = silent_observer());

/// Displacement of each probe (mm, 3 × probes) in a frame; NaN where its tissue is gone.
Eigen::Matrix3Xd probe_displacements(const BuiltScene& built, const Frame& frame);

/// Displacement by node of the scene's mesh, mm; NaN where tissue is gone or left out.
Eigen::Matrix3Xd on_scene_mesh(const BuiltScene& built, const Frame& frame);

}  // namespace tissuewarp::simulation
