#pragma once
/// Label volume → conforming multi-label tetrahedra with CGAL Mesh_3.

#include "core/observer.hpp"
#include "imaging/volume.hpp"
#include "meshing/tet_mesh.hpp"

#include <map>
#include <vector>

namespace tissuewarp::meshing {

enum class Refinement {
    Deterministic,  ///< one thread: equal input gives the equal mesh
    Parallel,       ///< all threads: another mesh of the same quality every time
};

struct MeshingOptions {
    double edge_length = 5.0;                   ///< mm, target edge in the interior and on surfaces
    std::map<int, double> label_edge_length{};  ///< mm, per label, overriding edge_length
    double facet_distance = 0.0;                ///< mm, facet to interface; 0: 0.12 edge lengths, at least 0.25 voxel
    double facet_angle = 25.0;                  ///< degrees, lower bound on triangle angles, at most 30
    double radius_edge_ratio = 2.0;             ///< upper bound on circumradius over shortest edge
    double smoothing = 0.8;  ///< voxels, Gaussian that turns voxel steps into smooth interfaces; 0 keeps the steps
    double min_dihedral_deg = 12.0;  ///< sliver bound that perturbation and exudation work towards
    double perturb_seconds = 60.0;   ///< safety limit; reaching it ties the mesh to the machine; 0 skips
    double exude_seconds = 60.0;     ///< safety limit, likewise; 0 skips
    std::vector<int> labels{};       ///< labels to mesh; empty: all but 0
    Refinement refinement = Refinement::Deterministic;
};

/// Meshes the labels of an int32 label volume. Smooth conforming interfaces: each label's indicator is smoothed and a
/// point belongs to the label with the largest value. The result lies in LPS mm whatever the image's axes, is
/// positively oriented, keeps label values, and has no unused nodes. Disconnected pieces smaller than half an element
/// go to their surroundings (noted to the observer) unless a label has nothing larger. After refinement nodes move so
/// that facets straddle the interfaces (no loss of volume) and the worst elements allow a longer time step.
///
/// Throws InvalidInput (no voxel
/// of a requested label, less than half of the tissue's volume meshed, edge length not positive or finer than a memory
/// guard) and Cancelled.
TetMesh mesh_labels(const imaging::Volume& labels, const MeshingOptions& options = {},
                    Observer& observer = silent_observer());

/// Fidelity of a mesh to the label volume it came from.
struct Fidelity {
    std::map<int, double> volume_ratio;   ///< mesh volume over voxel volume, per label
    double mean_surface_distance_mm = 0;  ///< from mesh interface faces to the label boundary
    double hausdorff_95_mm = 0;           ///< 95th percentile, symmetric
    double hausdorff_mm = 0;              ///< maximum, symmetric
};
Fidelity fidelity(const TetMesh& mesh, const imaging::Volume& labels);

}  // namespace tissuewarp::meshing
