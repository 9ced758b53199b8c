#pragma once
/// Delaunay refinement of a label field (Boissonnat and Oudot 2005; Jamin et al. 2015), in one thread or in many.

#include "core/observer.hpp"
#include "meshing/detail/label_field.hpp"
#include "meshing/detail/surface_seeds.hpp"
#include "meshing/mesher.hpp"

namespace tissuewarp::meshing::detail {

struct RefinementInput {
    const LabelGrid& grid;
    const LabelField& field;
    const std::vector<SurfaceSeed>& seeds;
    const std::vector<double>& edge_length;  ///< mm, per class
    double facet_distance;                   ///< mm
    const MeshingOptions& options;
};

/// Tetrahedra in the local frame; their labels are classes. Sequential: equal input gives equal meshes. Parallel:
/// another mesh of the same quality every time. Throw Cancelled.
TetMesh refine_sequential(const RefinementInput& input, Observer& observer);
TetMesh refine_parallel(const RefinementInput& input, Observer& observer);

}  // namespace tissuewarp::meshing::detail
