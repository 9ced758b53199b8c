#pragma once
/// Whether the vectors of a file are displacements.

#include "imaging/volume.hpp"

#include <filesystem>

namespace tissuewarp::registration {

/// Throws InvalidInput, naming the file, where three channels of float32 grow as coordinates do: positions in mm (LPS,
/// RAS or of other signs) or in voxels, as some programs write maps. Displacements of tissue, turns and stretches pass.
void require_displacements(const imaging::Volume& field, const std::filesystem::path& path);

}  // namespace tissuewarp::registration
