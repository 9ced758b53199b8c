#pragma once
/// Where to look first: pairs of points on either side of every connected piece's surface, so that none is missed.

#include "core/observer.hpp"
#include "meshing/detail/label_field.hpp"

namespace tissuewarp::meshing::detail {

struct SurfaceSeed {
    Eigen::Array3d inside, outside;  ///< adjacent voxel centres of different class, local frame, mm
};

/// A few pairs per connected piece of every class, background cavities included, spread over its surface. `edge_length`
/// is the target edge of each class (mm); pieces get up to six pairs 0.25 edges apart, then
/// more as long as they lie 0.7 edges apart. Seeds of neighbouring pieces keep the same distances, for a close pair
/// would force tiny elements.
/// Pieces of the classes marked in `thin` get a dense cluster at one place besides: refinement looks for an interface
/// where the two ends of a Voronoi edge differ, and long edges pass through a membrane from outside to outside.
/// Takes a time with the square of the number of pieces: throws Cancelled between two of them.
std::vector<SurfaceSeed> surface_seeds(const LabelGrid& grid, const LabelField& field,
                                       const std::vector<double>& edge_length, const std::vector<char>& thin,
                                       Observer& observer = silent_observer());

}  // namespace tissuewarp::meshing::detail
