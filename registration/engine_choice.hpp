#pragma once
/// Where the equilibrium and the forces of images are computed.

#include "registration/matching/dense/image_engine.hpp"
#include "registration/prepare.hpp"

namespace tissuewarp::registration::detail {

/// The engine that the options ask for. `Auto` takes a hardware GPU for models large enough to profit, and the CPU when
/// there is none or when it cannot be trusted (noted). Throws GpuUnavailable when a GPU was demanded.
std::unique_ptr<tled::Engine> make_engine(const PreparedModel& prepared, const UpdateOptions& options,
                                          Observer& observer);

/// The same of dense forces, for which every hardware GPU is worth while. Mesh and image outlive it.
std::unique_ptr<ImageEngine> make_image_engine(const meshing::TetMesh& mesh, const ImageModel& image,
                                               const UpdateOptions& options, Observer& observer);

}  // namespace tissuewarp::registration::detail
