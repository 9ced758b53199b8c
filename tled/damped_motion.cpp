#include "tled/damped_motion.hpp"

#include "tled/dynamics.hpp"

#include <algorithm>

namespace tissuewarp::tled {

using Eigen::Matrix3Xd;

namespace {

constexpr double damping = 10;       // 1/s: soft tissue of some centimetres sways once or twice before it rests
constexpr double ramp_s = 0.25;      // of the loads
constexpr double window_s = 0.25;    // over which it is asked whether the tissue still moves
constexpr double longest_s = 4;      //
constexpr double at_rest_mm = 0.05;  // of motion in a window

}  // namespace

Matrix3Xd displacement_after_motion(Engine& engine, const RestState& rest,
                                    const std::function<NodalConditions(double part)>& at, const Matrix3Xd& start,
                                    Observer& observer) {
    const Matrix3Xd mass = rest.lumped_mass.transpose().replicate(3, 1);
    DynamicsState state{start, Matrix3Xd::Zero(3, start.cols()), 0.0};
    DynamicsOptions options;
    options.damping = damping;
    NodalConditions now;
    const auto in_time = [&](double time) -> const NodalConditions& { return now = at(std::min(1.0, time / ramp_s)); };
    while (state.time < longest_s) {
        const Matrix3Xd before = state.displacement;
        const bool loading = state.time < ramp_s;
        const ChangingConditions changing{in_time, loading ? ramp_s / 100 : 0.0};
        const double end = state.time + window_s;
        state = dynamics(engine, rest, mass, changing, state, window_s, options, observer).state;
        state.time = end;
        const double moved = (state.displacement - before).colwise().norm().maxCoeff();
        if (!loading && moved < at_rest_mm) break;
    }
    return state.displacement;
}

}  // namespace tissuewarp::tled
