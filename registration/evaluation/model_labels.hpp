#pragma once
/// What a deformed model shows of the labels that it was made of.

#include "imaging/volume.hpp"
#include "registration/deformation.hpp"

namespace tissuewarp::registration::detail {

/// On a grid of the fixed image, int32: of each voxel whose centre lies in a deformed tetrahedron the label of the
/// moving map (int32) where that tissue was, 0 elsewhere. Takes no continuation outside the mesh, and a small fraction
/// of its time.
imaging::Volume labels_of_model(const Deformation& deformation, const imaging::Volume& moving_labels,
                                const imaging::Geometry& grid);

}  // namespace tissuewarp::registration::detail
