#pragma once
/// Rigid bodies as sampled distances.

#include "core/observer.hpp"
#include "imaging/volume.hpp"
#include "simulation/scene.hpp"
#include "tled/effects.hpp"

namespace tissuewarp::simulation {

/// The body of a contact around tissue (3 × N nodes that may touch it, mm, at rest), reaching as far as the tissue may
/// move relative to it: a quarter of the tissue's extent besides the body's own motion. `labels` is the volume that
/// labels of the body are looked up in, or null. A body that overlaps the tissue at rest by up to `overlap` (mm) is
/// made smaller until it only touches; the observer is told.
///
/// Throws InvalidInput for a deeper overlap, for labels that are not there, and for an open surface.
tled::Obstacle obstacle(const Contact& contact, const Eigen::Matrix3Xd& tissue, double overlap,
                        const imaging::Volume* labels, Observer& observer);

}  // namespace tissuewarp::simulation
