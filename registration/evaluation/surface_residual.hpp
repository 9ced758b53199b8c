#pragma once
/// How far data that a registration was not given lie from where it put the organ's surface.

#include "registration/evaluation.hpp"

#include "meshing/tet_mesh.hpp"

namespace tissuewarp::registration {

struct SurfaceResidual {
    Summary distance;       ///< mm, from each point to the closest one on the surface
    double mean_signed_mm;  ///< the same, positive outside the organ and negative within
};

/// Residual of points (3 × P, LPS mm) at a surface in the same frame. Throws InvalidInput for points that are not
/// finite, none at all, and where none lies within 100 mm of the surface, which is another frame or unit.
SurfaceResidual surface_residual(const meshing::SurfaceMesh& surface, const Eigen::Matrix3Xd& points);

}  // namespace tissuewarp::registration
