#pragma once
/// Where labels lie, and how the organ was stretched as a whole: the start of a registration of tissue that changes its
/// size and shape freely, as lungs do.

#include "core/observer.hpp"
#include "imaging/volume.hpp"
#include "registration/options.hpp"

#include <Eigen/Geometry>

namespace tissuewarp::registration::detail {

/// How a stretch is searched. Set by hand; tried on synthetic breaths and patients (docs/decisions/large_motion.md).
struct FreeStretchOptions {
    int samples = 6000;            ///< boundary points used, half from each image
    double trim_mm = 40;           ///< distances beyond this count as this much
    int evaluations = 1500;        ///< of the cost, at most
    double first_step_mm = 5;      ///< of each parameter, at the boundary; half of what the stretch may be at most
    double tolerance_mm = 0.02;    ///< of each parameter
    double extent_percentile = 5;  ///< of boundary points, that the start brings together along each axis, and 100 less
};
inline constexpr FreeStretchOptions free_stretch_options{};

struct FreeStretch {
    Eigen::Affine3d stretch = Eigen::Affine3d::Identity();        ///< symmetric linear part, moving frame
    Eigen::Isometry3d placement = Eigen::Isometry3d::Identity();  ///< moving → fixed, after the stretch
    double mean_distance_mm = 0;                                  ///< of the boundaries, truncated, as LabelDistance
};

/// Minimises the symmetric mean distance between moving and fixed boundaries over a symmetric stretch, the entries of
/// whose logarithm lie within ± `most`, and a shift, by BOBYQA (Powell 2009). The organ is turned as the headers say;
/// with `alignment`, where the boundaries come much nearer so (LabelRivalOptions), as that says. A turn is not sought
/// along with the stretch: boundaries of lungs tell it badly. Throws InvalidInput when the maps share no label,
/// Cancelled.
FreeStretch find_free_stretch(const imaging::Volume& moving_labels, const imaging::Volume& fixed_labels, double most,
                              const AlignmentOptions* alignment, Observer& observer);

}  // namespace tissuewarp::registration::detail
