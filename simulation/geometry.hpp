#pragma once
/// The geometry of a scene as a mesh.

#include "core/observer.hpp"
#include "simulation/scene.hpp"

namespace tissuewarp::simulation {

/// Labels of the volume that have a tissue, the mesh as given, or the primitive. Throws InvalidInput for a label
/// without tissue in a mesh or a primitive, and what the mesher refuses; Cancelled.
meshing::TetMesh mesh_of(const Scene& scene, Observer& observer);

/// The volume of labels that the scene is made of; null where it is made of something else.
const imaging::Volume* label_volume(const Scene& scene);

/// Labels painted from shapes, on voxels of `spacing` (mm) with a margin of two.
imaging::Volume painted(const std::vector<Shape>& shapes, double spacing);

}  // namespace tissuewarp::simulation
