#pragma once
/// Wall-clock seconds.

#include <chrono>

namespace tissuewarp::study::detail {

/// Seconds since it was made.
class Clock {
public:
    [[nodiscard]] double seconds() const {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
    }

private:
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace tissuewarp::study::detail
