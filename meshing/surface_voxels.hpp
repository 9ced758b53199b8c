#pragma once
/// Closed surface → voxels.

#include "imaging/volume.hpp"
#include "meshing/closed_surface.hpp"

namespace tissuewarp::meshing {

/// A grid about the surface, along the axes of the frame, for a label map of what it encloses.
struct SurfaceGridOptions {
    double voxels_across = 100;  ///< of a cube of the body's volume: a fifth of an edge of the finest mesh
    double margin = 0.15;        ///< of the longest side of its box, on each side
    double most_voxels = 2e7;    ///< coarser where the box is mostly empty
};

imaging::Geometry grid_about(const ClosedSurface& surface, const SurfaceGridOptions& options = {});

/// uint8: 1 where the voxel's centre lies inside, which is where a ray from outside has crossed an odd number of
/// triangles. Inner surfaces are cavities. Exact up to rounding; what lies off the grid is cut.
imaging::Volume voxels_inside(const SurfaceMesh& surface, const imaging::Geometry& grid);

}  // namespace tissuewarp::meshing
