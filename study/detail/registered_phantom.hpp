#pragma once
/// What calibration and trials of the dial do with a phantom alike.

#include "registration/deformation.hpp"
#include "registration/dial/dial.hpp"
#include "registration/evaluation.hpp"
#include "registration/intraoperative.hpp"
#include "study/phantom.hpp"

namespace tissuewarp::study::detail {

/// Millions of voxels.
double megavoxels(const imaging::Geometry& grid);

/// The labels of the operation, or a part of the surface and pairs of points.
registration::Intraoperative seen_of(const Phantom& phantom, registration::DataKind kind);

/// Root mean square distance of the targets from where they truly are, mm.
double root_mean_square_error(const registration::Deformation& deformation, const registration::Landmarks& targets);

}  // namespace tissuewarp::study::detail
