#pragma once
/// Prepared models as files, so that the preparation happens before the operation (HDF5, docs/record.md).

#include "registration/prepare.hpp"

#include <filesystem>

namespace tissuewarp::registration {

/// Writes mesh, that of the coarser model if any, label map and options to a temporary name and renames. Throws
/// IoError.
void write_prepared(const PreparedModel& prepared, const std::filesystem::path& path);

/// Reads them and makes rest state and factor anew, those of the coarser model too where there was one: the factor of a
/// head (58 000 tetrahedra) has 171 MB and takes a second to make, while meshing, the long part, is not repeated. The
/// model's materials and element are those that were prepared, whatever the defaults of this version. Throws IoError,
/// InvalidInput, Cancelled.
PreparedModel read_prepared(const std::filesystem::path& path, Observer& observer = silent_observer());

}  // namespace tissuewarp::registration
