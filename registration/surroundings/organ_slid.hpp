#pragma once
/// Whether an organ slid along its surroundings, as a lung does along ribs: what lies beside it then moved across its
/// surface alone, and a field that drags it along with the surface's tissue bends bone.

#include "registration/deformation.hpp"
#include "registration/field/continuation.hpp"
#include "registration/surroundings/surroundings_motion.hpp"

namespace tissuewarp::registration::detail {

/// The first three were chosen by hand before any image was looked at, the others on the brain-shift phantom.
struct SlidingOptions {
    double apart_mm = 2;         ///< are both motions where a place tells which is right
    double least_cm3 = 20;       ///< of such places
    double gain = 1.2;           ///< what motion with the surface must leave over what motion across it leaves
    double continuation_mm = 8;  ///< spacing of the continuations that are tried
    double window_mm = 3.5;      ///< standard deviation of the window around each
};
inline constexpr SlidingOptions sliding_options{};

/// Two motions of what lies beside the organ: with its surface's tissue, or across its surface alone.
struct MotionsBeside {
    Continuation with, across;
};
MotionsBeside motions_beside(const Deformation& deformation, double fade_mm);

/// The intraoperative image explains the preoperative one better where it is read after a motion across the surface
/// than with it, over all places where the two are apart; better by windowed linear fits (window_fit.hpp), so contrast
/// and brightness may differ.
bool organ_slid(const Deformation& deformation, const MotionsBeside& beside, const Outside& outside);

}  // namespace tissuewarp::registration::detail
