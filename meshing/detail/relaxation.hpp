#pragma once
/// After refinement: interfaces without the bias of chords, and no element that limits the time step more than it must.

#include "meshing/detail/label_field.hpp"
#include "meshing/tet_mesh.hpp"

#include <vector>

namespace tissuewarp::meshing::detail {

struct RelaxationInput {
    const LabelField& field;
    const std::vector<double>& edge_length;  ///< mm, per class
    double voxel;                            ///< mm, smallest spacing
    double facet_distance;                   ///< mm
    double min_dihedral_deg;  ///< moves never push an element below the lower of this and its present angle
};

/// Moves nodes of a mesh in the local frame whose labels are classes; connectivity stays.
///
/// Fitting: refinement puts the nodes of an interface on it, so that every facet of a convex organ is a chord inside it
/// and the organ loses volume. Each node moves by the area-weighted mean of its facets' signed distances to the
/// interface, which then lies as much in front of the facets as behind them.
///
/// Relaxing: the critical time step is that of the worst element, 2 / (c √(Σ|∇N|²)). Nodes of the worst elements move,
/// interior ones freely and interface ones in their tangent plane, where that raises the smallest 1/√(Σ|∇N|²) around
/// them.
///
/// Nodes are visited in order, one after the other: the result is the same on every machine and number of threads.
void relax(TetMesh& mesh, const RelaxationInput& input);

}  // namespace tissuewarp::meshing::detail
