#pragma once
/// A sweep by hand, as a tracker and a calibration have it.

#include "imaging/sweep.hpp"
#include "study/detail/random.hpp"
#include "study/detail/ultrasound_beam.hpp"

namespace tissuewarp::study::detail {

/// How wrong a frame's place is: standard deviations along and about each axis.
struct TrackingErrors {
    double calibration_mm = 0.4, calibration_deg = 0.3;  ///< the same for all frames
    double tracking_mm = 0.15, tracking_deg = 0.1;       ///< of each
};

/// Frames that a hand takes of what a scanner would show everywhere (float32, 0 outside of the fan): steps of 0.3 to
/// 0.9 mm, wandering and tilting by some mm and degrees, 0.3 mm a pixel, 8 bits. Their places are wrong as `errors` has
/// it.
imaging::Sweep tracked_frames(const imaging::Volume& scanned, const Sweep& sweep, const TrackingErrors& errors,
                              Random& random);

}  // namespace tissuewarp::study::detail
