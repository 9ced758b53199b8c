#pragma once
/// Rigid bodies as sampled distances.

#include "core/observer.hpp"
#include "imaging/volume.hpp"
#include "simulation/scene.hpp"
#include "tled/effects.hpp"

namespace tissuewarp::simulation {

/// The body of a contact around tissue (3 × N nodes that may touch it, mm, at rest), reaching as far as the tissue may
/// move relative to it: a quarter of the tissue's extent besides the body's own motion. `labels` is the volume that
/// labels of the body are looked up in, or null. A plane that does not turn has no end. A body that overlaps the tissue
/// at the beginning by up to `overlap` (mm) is made smaller until it only touches; the observer is told.
///
/// The obstacle is where the body is at time 0, which is where overlap is looked for.
///
/// Throws InvalidInput for a deeper overlap, for labels that are not there, and for an open surface.
tled::Obstacle obstacle(const Contact& contact, const Eigen::Matrix3Xd& tissue, double overlap,
                        const imaging::Volume* labels, Observer& observer);

/// How many of the places (3 × N, mm) lie beyond the body's samples, where contact does not see them, and in the body,
/// or, of labels and surfaces, so that it lies between them and where they are at rest (3 × N). `obstacle`: the body
/// where it is now.
int passed_unseen(const Contact& contact, const tled::Obstacle& obstacle, const Eigen::Matrix3Xd& rest,
                  const Eigen::Matrix3Xd& places, const imaging::Volume* labels);

/// How far the surface that a grid holds reaches from the axis of a motion, mm, by the samples of the cells that it
/// goes through; 0 without a turn.
double surface_reach(const tled::DistanceGrid& grid, const RigidMotion& motion);

}  // namespace tissuewarp::simulation
