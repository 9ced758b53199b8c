#pragma once
/// A prior deformation: the shape that tissue takes without strain, where that is not the one in which it was imaged.

#include "registration/prepare.hpp"

#include <Eigen/Geometry>

namespace tissuewarp::registration::detail {

/// The same model whose tissue is free of strain in the image of its shape under `map` (moving → stretched, mm, linear
/// part of positive determinant): nodes, labels, interfaces, rest state and stiffness. Displacements of it start from
/// there. Without images, anchors and rigid neighbours. Throws InvalidInput, Cancelled.
PreparedModel strain_free_under(const PreparedModel& prepared, const Eigen::Affine3d& map, Observer& observer);

}  // namespace tissuewarp::registration::detail
