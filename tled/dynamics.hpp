#pragma once
/// Transient response by the central-difference method with mass-proportional damping (Miller et al. 2007), watched for
/// stability while it runs.

#include "core/observer.hpp"
#include "tled/engine.hpp"

#include <functional>
#include <vector>

namespace tissuewarp::tled {

struct DynamicsState {
    Eigen::Matrix3Xd displacement;  ///< 3 × N, mm
    Eigen::Matrix3Xd velocity;      ///< 3 × N, mm/s
    double time = 0;                ///< s
};

/// Of the discrete model, mN·mm. `total` is what the central-difference method conserves in linear problems without
/// damping: kinetic energy of the half step, mean of the potential at both its ends, −¼ Δu·K Δu.
struct EnergyBalance {
    double kinetic = 0;
    double potential = 0;  ///< elastic energy, springs and effects, less the work of constant forces
    double total = 0;
    double largest_growth = 0;  ///< of `total` over its first value, relative to the largest exchange of energy so far
};

struct DynamicsOptions {
    double damping = 0.0;            ///< α of C = α M, 1/s
    double step = 0.0;               ///< s; 0 takes `safety` of the critical step
    double safety = 0.9;             ///< part of the critical step; 0.95 has been seen to blow up
    int steps_per_check = 200;       ///< between looks at energy, J, and the critical step, which falls under load
    double energy_tolerance = 0.02;  ///< growth of energy that calls for a smaller step
    std::vector<double> stops{};     ///< s, ascending: times that a check falls on exactly
    std::function<void(const DynamicsState&, const EnergyBalance&)> watch{};  ///< called at every check
};

/// Conditions that change while the tissue moves. What is constrained must not.
struct ChangingConditions {
    std::function<const NodalConditions&(double time)> at;  ///< valid until the next call
    /// s, for which they are held, each time as they are at its end; ten steps at least. 0: they stay as at the start.
    double interval = 0;
};

struct DynamicsResult {
    DynamicsState state;
    EnergyBalance energy;
    double step = 0;           ///< s, the last one
    double critical_step = 0;  ///< s, where it was smallest
    int steps = 0;
    int cuts = 0;  ///< times that the step was cut
    double min_jacobian = 1;
};

/// Advances by `duration` (s) under constant conditions with the engine's mass `mass` (3 × N, kg; set here). Loads come
/// at once. A step above the critical one, which pairs that may part halve, is refused (InvalidInput). When energy
/// grows, tissue inverts that must not, or a value is not finite, the run goes back to the last good state and takes
/// half the step; after six cuts it throws SolverFailure with cause, time and place, and leaves the engine in the last
/// good state. Viscous tissue may give back what it stored, pressures and obstacles may do work that no potential
/// tells, and steps go over the kink of pairs that may part, so only a doubling of energy counts as growth there.
DynamicsResult dynamics(Engine& engine, const RestState& rest, const Eigen::Matrix3Xd& mass,
                        const NodalConditions& conditions, const DynamicsState& start, double duration,
                        const DynamicsOptions& options = {}, Observer& observer = silent_observer());

/// The same under conditions that change. Energy is watched over the last interval before each check, since loads that
/// change do work.
DynamicsResult dynamics(Engine& engine, const RestState& rest, const Eigen::Matrix3Xd& mass,
                        const ChangingConditions& conditions, const DynamicsState& start, double duration,
                        const DynamicsOptions& options = {}, Observer& observer = silent_observer());

}  // namespace tissuewarp::tled
