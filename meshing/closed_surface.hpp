#pragma once
/// Triangles that enclose a body.

#include "meshing/tet_mesh.hpp"

#include <string>
#include <vector>

namespace tissuewarp::meshing {

struct ClosedSurface {
    SurfaceMesh mesh;  ///< equal nodes are one, triangles without area by their nodes are gone
    /// By the triangles' orientation, above 0; 0 where neighbours disagree on which side is outside.
    double volume_mm3 = 0;
    std::vector<std::string> notes;  ///< what was not as it should be, and did no harm
};

/// Nodes of equal coordinates are merged, as STL files and ultrasound models repeat them. Throws InvalidInput without
/// triangles, or where edges belong to an odd number of triangles, with how many. Its words go behind a file's name.
ClosedSurface closed_surface(const SurfaceMesh& surface);

}  // namespace tissuewarp::meshing
