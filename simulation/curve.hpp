#pragma once
/// How far a load has come at a time.

#include <vector>

namespace tissuewarp::simulation {

struct CurvePoint {
    double time = 0.0;   ///< s
    double value = 0.0;  ///< of the load, 1 for all of it
};

/// Piecewise linear through its points, constant before the first and after the last. Without points it rises from 0
/// at time 0 to 1 at the end of the scene.
struct Curve {
    std::vector<CurvePoint> points;  ///< times strictly ascending
};

/// Throws InvalidInput, naming `what`, unless times ascend and all numbers are finite.
void require_valid(const Curve& curve, const char* what);

/// Value at `time` (s) in a scene of length `duration` (s, > 0).
double value_at(const Curve& curve, double time, double duration);

/// Change of value per second just before `time`.
double slope_before(const Curve& curve, double time, double duration);

/// Least and largest value.
struct CurveRange {
    double least = 0.0, largest = 1.0;
};
CurveRange range_of(const Curve& curve);

/// Largest |change of value| per second within [0, duration].
double steepest(const Curve& curve, double duration);

}  // namespace tissuewarp::simulation
