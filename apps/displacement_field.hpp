#pragma once
/// Displacement fields of this program and of others.

#include "core/observer.hpp"
#include "imaging/volume.hpp"

#include <filesystem>

namespace tissuewarp::apps {

/// Displacements in LPS mm, float32. Throws IoError, or InvalidInput where there are not three components, where the
/// grid's extent is no part of a body, and where vectors grow as coordinates in mm or as voxels do: those are
/// positions.
imaging::Volume read_displacement(const std::filesystem::path& path, Observer& observer);

}  // namespace tissuewarp::apps
