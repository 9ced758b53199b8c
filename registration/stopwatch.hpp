#pragma once
/// Wall-clock times of stages.

#include "registration/pipeline.hpp"

#include <chrono>

namespace tissuewarp::registration::detail {

class Stopwatch {
public:
    /// Seconds since the last lap, under a name.
    StageTime lap(std::string stage) {
        const auto now = std::chrono::steady_clock::now();
        const double seconds = std::chrono::duration<double>(now - last_).count();
        last_ = now;
        return {std::move(stage), seconds};
    }

private:
    std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

}  // namespace tissuewarp::registration::detail
