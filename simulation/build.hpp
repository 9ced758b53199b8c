#pragma once
/// A scene on its mesh.

#include "core/observer.hpp"
#include "meshing/point_location.hpp"
#include "simulation/scene.hpp"
#include "tled/conditions.hpp"
#include "tled/model.hpp"
#include "tled/rest_state.hpp"
#include "tled/tissue_mesh.hpp"

#include <vector>

namespace tissuewarp::simulation {

/// The tissue that is simulated from a time on, until the next resection. Nodes and tetrahedra count anew in each
/// stage.
struct Stage {
    double begin = 0.0;  ///< s
    tled::Model model;
    tled::RestState rest;
    std::vector<tled::SurfacePressure> growth;  ///< what growth comes down to besides moduli (tled/growth.hpp)
    std::vector<int> node;                      ///< of the scene's mesh, ascending
    std::vector<int> tet;                       ///< likewise
    std::vector<int> place;  ///< node of the scene's mesh → node of this one, −1 where it is gone
};

/// Components of a node that are held or moved.
struct HeldNode {
    int node = -1;
    std::array<int, 3> motion{none, none, none};  ///< index into Scene::motions of each component; or one of
    static constexpr int none = -2, fixed = -1;
};

/// Everything that does not change with time is found here once. Nodes are those of the scene's mesh.
struct BuiltScene {
    Scene scene;
    meshing::TetMesh mesh;       ///< all tissue at rest, opened where it slides
    std::vector<Stage> stages;   ///< one at least, in the order of time
    std::vector<HeldNode> held;  ///< by node
    std::vector<tled::Spring> springs;
    std::vector<Eigen::Matrix3Xi> traction_faces;  ///< of each traction, 3 × F
    tled::Effects effects;  ///< pressures and levels where their curves are 1, obstacles where they are at time 0
    std::vector<meshing::Location> probes;  ///< of Scene::probes, in that mesh
};

/// Meshes and checks. Throws InvalidInput as require_valid(), mesh_of(), RegionFinder and obstacle() do, for probes
/// outside the tissue, and for a component of a node that is held or moved twice; Cancelled.
BuiltScene build(const Scene& scene, Observer& observer = silent_observer());
/// The same on a mesh that mesh_of() has made of the scene before.
BuiltScene build(const Scene& scene, const meshing::TetMesh& mesh, Observer& observer = silent_observer());

}  // namespace tissuewarp::simulation
