#pragma once
/// What holds an HDF5 file together, followed before HDF5 follows it.

#include <filesystem>

namespace tissuewarp::detail {

/// Follows superblock, object headers, groups, data and texts of an HDF5 file (format specification 2.0 and 3.0) as far
/// as the files of this program and the transforms of ITK have them, and throws IoError where an address or a length
/// leaves the file, where a part refers to itself, and for types, layouts and filters that neither has. HDF5 1.10
/// believes them: it crashes, loops for ever, or asks for terabytes. Of groups of HDF5 1.8 those of eight parts
/// at most are taken.
void require_sound_hdf5(const std::filesystem::path& path);

}  // namespace tissuewarp::detail
