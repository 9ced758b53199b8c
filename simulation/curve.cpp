#include "simulation/curve.hpp"

#include "core/errors.hpp"

#include <algorithm>
#include <cmath>
#include <string>

namespace tissuewarp::simulation {

void require_valid(const Curve& curve, const char* what) {
    for (std::size_t i = 0; i < curve.points.size(); ++i) {
        const CurvePoint& point = curve.points[i];
        if (!std::isfinite(point.time) || !std::isfinite(point.value))
            throw InvalidInput(std::string(what) + " has a point that is not finite");
        if (i > 0 && !(point.time > curve.points[i - 1].time))
            throw InvalidInput(std::string(what) + " goes back from " + std::to_string(curve.points[i - 1].time) +
                               " s to " + std::to_string(point.time) + " s; give points in the order of their times");
    }
}

double value_at(const Curve& curve, double time, double duration) {
    if (curve.points.empty()) return std::clamp(time / duration, 0.0, 1.0);
    const auto after = std::find_if(curve.points.begin(), curve.points.end(),
                                    [&](const CurvePoint& point) { return point.time > time; });
    if (after == curve.points.begin()) return after->value;
    if (after == curve.points.end()) return curve.points.back().value;
    const CurvePoint& before = *(after - 1);
    return before.value + (after->value - before.value) * (time - before.time) / (after->time - before.time);
}

double slope_before(const Curve& curve, double time, double duration) {
    if (curve.points.empty()) return time > 0 && time <= duration ? 1 / duration : 0.0;
    for (std::size_t i = 1; i < curve.points.size(); ++i) {
        const CurvePoint &from = curve.points[i - 1], &to = curve.points[i];
        if (from.time < time && time <= to.time) return (to.value - from.value) / (to.time - from.time);
    }
    return 0.0;
}

CurveRange range_of(const Curve& curve) {
    if (curve.points.empty()) return {};
    const auto [least, largest] =
        std::minmax_element(curve.points.begin(), curve.points.end(),
                            [](const CurvePoint& a, const CurvePoint& b) { return a.value < b.value; });
    return {least->value, largest->value};
}

double steepest(const Curve& curve, double duration) {
    if (curve.points.empty()) return 1 / duration;
    double slope = 0;
    for (std::size_t i = 1; i < curve.points.size(); ++i) {
        const CurvePoint &from = curve.points[i - 1], &to = curve.points[i];
        if (to.time <= 0 || from.time >= duration) continue;
        slope = std::max(slope, std::abs(to.value - from.value) / (to.time - from.time));
    }
    return slope;
}

}  // namespace tissuewarp::simulation
