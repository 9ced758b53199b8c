#pragma once
/// Signed distance to a closed surface.

#include "meshing/tet_mesh.hpp"

#include <Eigen/Core>

namespace tissuewarp::simulation {

/// Negative inside, by the solid angle under which the surface is seen (van Oosterom and Strackee 1983). Every query
/// looks at all triangles.
class SurfaceDistance {
public:
    /// Throws InvalidInput unless every edge belongs to two triangles and the normals point outward.
    explicit SurfaceDistance(const meshing::SurfaceMesh& surface);

    /// mm. Thread-safe.
    double operator()(const Eigen::Vector3d& point) const;

private:
    meshing::SurfaceMesh surface_;
};

}  // namespace tissuewarp::simulation
