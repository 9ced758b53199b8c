#pragma once
/// Rigid alignment, the first stage of every registration.

#include "core/observer.hpp"
#include "imaging/volume.hpp"
#include "meshing/tet_mesh.hpp"
#include "registration/intraoperative.hpp"
#include "registration/options.hpp"
#include "registration/result.hpp"

#include <Eigen/Geometry>

namespace tissuewarp::registration {

/// What of labels is aligned. Chosen by hand; on which data is not recorded.
struct LabelPoseOptions {
    int most_labels = 4;          ///< beside all together, the largest: many small ones add time, not certainty
    double map_spacing_mm = 2.0;  ///< of the distance maps: linear interpolation in them is good to a fraction of it
};

/// Minimises the symmetric mean truncated distance between moving and fixed boundaries (distance maps), of all labels
/// together and of the four largest that both maps hold, by BOBYQA (Powell 2009) from several starts: as the headers
/// say, centroids matched, and rotations about them; where boundaries stay apart, from all that turn a cube into itself
/// too (label_rivals.hpp). A change of size is fitted along with the pose and then left to
/// the tissue: the placement is rigid, and turned no further than the boundaries demand. Throws InvalidInput when the
/// maps share no label.
Alignment align_labels(const imaging::Volume& moving_labels, const imaging::Volume& fixed_labels,
                       const AlignmentOptions& options = {}, Observer& observer = silent_observer());

namespace detail {
class LabelBoundaries;

/// The same of maps whose boundaries are kept.
Alignment align_labels(LabelBoundaries& moving, LabelBoundaries& fixed, const AlignmentOptions& options = {},
                       Observer& observer = silent_observer());
}  // namespace detail

/// The placement of a whole moving surface (outward triangles) on points of a part of the fixed one, from anywhere: see
/// surface_pose.hpp. `mean_distance_mm` is the typical distance of those points that fit. Throws InvalidInput on
/// points or surfaces that cannot be used.
Alignment align_surfaces(const meshing::SurfaceMesh& moving, const SurfacePoints& fixed,
                         const AlignmentOptions& options = {}, Observer& observer = silent_observer());

}  // namespace tissuewarp::registration
