#pragma once
/// What a device can do at most: measured, to say which share of it a kernel reaches.

#include "shaders/device.hpp"

namespace tissuewarp::shaders {

struct Ceilings {
    double copy_bytes_per_second = 0;  ///< of a copy much larger than caches, bytes read and written together
    double fma_flops_per_second = 0;   ///< float32; a multiply-add counts as two
};

/// Best of several runs of copy_bandwidth.comp and fma_rate.comp, after the device has had `warm_up_seconds` of work to
/// reach its clock. Takes about that and a second. Throws GpuUnavailable.
Ceilings measured_ceilings(const Device& device, double warm_up_seconds = 1.0);

}  // namespace tissuewarp::shaders
