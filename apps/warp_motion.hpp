#pragma once
/// What `warp` carries things with, where it is a mesh that moved: a registration's record or a frame of a scene.

#include "apps/options.hpp"
#include "core/observer.hpp"
#include "imaging/volume.hpp"
#include "registration/deformation.hpp"

#include <optional>

namespace tissuewarp::apps {

struct WarpMotion {
    registration::Deformation deformation;  ///< a scene's has no placement
    meshing::TetMesh gone;                  ///< tissue at rest that a scene's resection took out; often no tetrahedra
    imaging::Volume resected;               ///< the same of a registration as a label map; often empty
};

/// Nothing where a displacement field on a grid was given. Throws InvalidInput where neither was, and for --frame
/// without a scene.
std::optional<WarpMotion> read_motion(const WarpOptions& options, Observer& observer);

/// Voxels of tissue that is gone become `outside`. Throws InvalidInput, with the file's name, for an image that shows
/// nothing of the mesh.
void take_out(imaging::Volume& image, const WarpMotion& motion, double outside, const std::filesystem::path& path);

/// Which points lie in tissue that is gone.
std::vector<bool> points_gone(const Eigen::Matrix3Xd& points, const WarpMotion& motion);

}  // namespace tissuewarp::apps
