#pragma once
/// Rigid alignment, the first stage of every registration.

#include "core/observer.hpp"
#include "imaging/volume.hpp"
#include "meshing/tet_mesh.hpp"
#include "registration/intraoperative.hpp"

#include <Eigen/Geometry>

namespace tissuewarp::registration {

struct AlignmentOptions {
    double trim_mm = 8.0;           ///< distances beyond this count as this much: what deformed does not drag the pose
    double start_angle_deg = 30.0;  ///< the search starts from rotations of up to this angle about each axis
    int samples = 6000;             ///< boundary points used, half from each image
};

struct Alignment {
    Eigen::Isometry3d placement = Eigen::Isometry3d::Identity();  ///< moving → fixed
    double mean_distance_mm = 0;  ///< mean truncated distance of the boundaries, with the fitted change of size
};

/// Minimises the symmetric mean truncated distance between moving and fixed boundaries (distance maps), of all labels
/// together and of the four largest that both maps hold, by BOBYQA (Powell 2009) from several starts: as the headers
/// say, centroids matched, and rotations about them. A change of size is fitted along with the pose and then left to
/// the tissue: the placement is rigid, and turned no further than the boundaries demand. Throws InvalidInput when the
/// maps share no label.
Alignment align_labels(const imaging::Volume& moving_labels, const imaging::Volume& fixed_labels,
                       const AlignmentOptions& options = {}, Observer& observer = silent_observer());

/// The placement of a whole moving surface (outward triangles) on points of a part of the fixed one, from anywhere: see
/// detail/surface_pose.hpp. `mean_distance_mm` is the typical distance of those points that fit. Throws InvalidInput on
/// points or surfaces that cannot be used.
Alignment align_surfaces(const meshing::SurfaceMesh& moving, const SurfacePoints& fixed,
                         const AlignmentOptions& options = {}, Observer& observer = silent_observer());

}  // namespace tissuewarp::registration
