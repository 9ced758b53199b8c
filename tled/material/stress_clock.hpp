#pragma once
/// When viscous stresses move on. They follow the strain within their relaxation times, which are long beside a time
/// step, so they take steps of their own, h of 1/32 of the shortest of these times, and rest in between: then a time
/// step reads them and neither computes S nor writes (docs/decisions/viscous_steps.md). A step of the stresses takes
/// them to the middle of the time for which they will rest, so that they are neither early nor late on average.

#include "tled/viscosity.hpp"

#include <limits>
#include <vector>

namespace tissuewarp::tled::detail {

/// Time steps that treat viscous stresses alike: each moves them on by `interval` s from the strain that it starts
/// with, or lets them rest where that is 0.
struct StressSteps {
    int count = 0;
    double interval = 0;
    friend bool operator==(const StressSteps&, const StressSteps&) = default;
};

enum class StressPace { TheirOwn, EveryStep };

/// Of all materials together: the shortest relaxation time sets the pace.
class StressClock {
public:
    explicit StressClock(const std::vector<PronySeries>& series, StressPace pace = StressPace::TheirOwn);

    /// What the next `steps` time steps of `time_step` s do, and counts them as done. With a time step of 0, and where
    /// nothing is viscous, stresses rest. Any division of a run into portions gives the same.
    std::vector<StressSteps> next(int steps, double time_step);
    /// s by which the stresses lag behind the present time; below 0 where they are ahead.
    [[nodiscard]] double lag() const { return since_ * time_step_ - ahead_; }
    /// No strain before now.
    void forget();

private:
    [[nodiscard]] int steps_of_interval() const;
    void change_time_step(double time_step);
    double move();

    StressPace pace_;
    double shortest_ = std::numeric_limits<double>::infinity();  ///< relaxation time, s
    double time_step_ = 0;
    double ahead_ = 0;  ///< s, of the stresses before the present time when they last moved
    double hold_ = 0;   ///< s for which they rest since
    int since_ = 0;     ///< steps of time_step_ since
};

}  // namespace tissuewarp::tled::detail
