#pragma once
/// What moves beside an organ that slides along it.

#include "meshing/tet_mesh.hpp"

#include <Eigen/Core>

namespace tissuewarp::registration::detail {

/// Motion of what lies against a surface that moves by `values` (3 × N, mm, at nodes of a mesh whose outer boundary is
/// given) and slides along it, 3 × N: at a node of the surface n nᵀ (c − X), with c the place nearest to X of the moved
/// surface among those that face as it does, and n the normal, smoothed over the neighbours. Only where the surface
/// goes counts, not which of its tissue lies there. Other nodes have that of the surface's node next to them.
Eigen::Matrix3Xd motion_across_surface(const Eigen::Matrix3Xd& nodes, const meshing::BoundarySurface& boundary,
                                       const Eigen::Matrix3Xd& values);

}  // namespace tissuewarp::registration::detail
