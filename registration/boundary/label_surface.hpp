#pragma once
/// The organ's surface as triangles, from its labels alone.

#include "imaging/volume.hpp"
#include "meshing/tet_mesh.hpp"

namespace tissuewarp::registration {

struct LabelSurfaceOptions {
    double smoothing_voxels = 0.8;  ///< standard deviation. Chosen by hand; on which data is not recorded
};

/// Boundary of the union of all labels, LPS mm, normals outward: surface nets [Gibson 1998] on the indicator smoothed
/// by a Gaussian of 0.8 voxels, a node per cell that the level ½ crosses, at the mean of the crossings of its edges. Of
/// a ball of radius R voxels it lies about 1/R voxels within. Open where the image's border cuts the organ. Throws
/// InvalidInput when there is no boundary.
meshing::SurfaceMesh label_surface(const imaging::Volume& labels);

}  // namespace tissuewarp::registration
