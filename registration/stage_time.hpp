#pragma once
/// Seconds of the stages of a run.

#include <string>
#include <vector>

namespace tissuewarp::registration {

/// Names of the stages of an update, as records and reports have them.
namespace stages {
inline constexpr const char* boundary_maps = "boundary maps";
inline constexpr const char* alignment = "rigid alignment";
inline constexpr const char* correspondence = "correspondence";
inline constexpr const char* equilibrium = "equilibrium";
inline constexpr const char* unknown_loads = "unknown loads";
inline constexpr const char* judgement = "judgement";       ///< how data and result agree
inline constexpr const char* in_vain = "going on in vain";  ///< of an update that then began anew
}  // namespace stages

/// Seconds spent in a named stage.
struct StageTime {
    std::string stage;
    double seconds = 0;
};

/// Adds to a stage, which comes last where it is new.
inline void add_time(std::vector<StageTime>& times, const std::string& stage, double seconds) {
    for (StageTime& time : times)
        if (time.stage == stage) {
            time.seconds += seconds;
            return;
        }
    times.push_back({stage, seconds});
}

}  // namespace tissuewarp::registration
