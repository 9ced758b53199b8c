#include "tled/statics/line_search.hpp"

#include "tled/stiffness/dot.hpp"

#include <algorithm>
#include <cmath>

namespace tissuewarp::tled::detail {

using Eigen::Matrix3Xd;

namespace {

constexpr double slope_kept = 0.9;  // a step is long enough when |r·d| falls below this part of its start
constexpr int most_trials = 12;

}  // namespace

std::optional<LineStep> line_search(EquilibriumSearch& search, const Matrix3Xd& displacement, const Matrix3Xd& residual,
                                    const Matrix3Xd& direction) {
    const double start = dot(residual, direction);
    if (!(start > 0)) return std::nullopt;
    double low = 0, low_slope = start, step = 1;
    std::optional<double> high;
    for (int trial = 0; trial < most_trials; ++trial) {
        if (!search.admissible(displacement + step * direction)) {
            high = step;
            step = 0.5 * (low + step);
            continue;
        }
        Matrix3Xd there = search.residual();
        const double slope = dot(there, direction);
        if (std::abs(slope) <= slope_kept * start) return LineStep{step, std::move(there)};
        const double secant = low + (step - low) * low_slope / (low_slope - slope);
        if (slope < 0) {
            high = step;
            step = std::clamp(secant, low + 0.1 * (step - low), low + 0.9 * (step - low));
        } else {
            const double beyond = slope < low_slope ? std::min(secant, 4 * step) : 4 * step;
            low = step;
            low_slope = slope;
            step = high ? std::min(beyond, 0.5 * (low + *high)) : beyond;
        }
    }
    return std::nullopt;
}

}  // namespace tissuewarp::tled::detail
