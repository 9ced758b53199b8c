#pragma once
/// Time as the device counts it.

#include "shaders/device.hpp"

namespace tissuewarp::shaders {

/// Measures what is recorded between start() and stop(). start() and stop() need the context current, and so does
/// seconds(), which waits for the device.
class GpuTimer {
public:
    explicit GpuTimer(const Device& device);
    ~GpuTimer();
    GpuTimer(const GpuTimer&) = delete;
    GpuTimer& operator=(const GpuTimer&) = delete;

    void start();
    void stop();
    [[nodiscard]] double seconds() const;

private:
    const Device& device_;
    unsigned query_ = 0;
};

}  // namespace tissuewarp::shaders
