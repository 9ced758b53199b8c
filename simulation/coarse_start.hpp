#pragma once
/// Where the equilibrium of a scene about lies, from the same scene on a coarser mesh.

#include "simulation/build.hpp"
#include "tled/load_path.hpp"

#include <optional>

namespace tissuewarp::simulation {

/// The same scene on a mesh of twice the edge. Nothing where it has a mesh of its own, fewer than 10 000 tetrahedra, or
/// interfaces, bodies and resections, where a place does not tell which tissue is there.
std::optional<Scene> coarser(const Scene& scene, int tetrahedra);

/// Displacements of nodes (3 × N, mm) carried on to other places (3 × P) of the same tissue: linear in tetrahedra, and
/// on beyond the surface, where meshes differ. Nothing where a place is farther out than a tetrahedron.
std::optional<Eigen::Matrix3Xd> carried_on(const meshing::TetMesh& mesh, const Eigen::Matrix3Xd& displacement,
                                           const Eigen::Matrix3Xd& places);

/// For the first stage at `time` (s), from the equilibrium of the coarser scene, which begins with a coarser one yet.
/// Nothing where there is none, or it finds no equilibrium. Throws Cancelled.
std::optional<tled::CoarseStart> coarse_start(const BuiltScene& built, double time, Observer& observer);

}  // namespace tissuewarp::simulation
