#pragma once
/// HDF5 files behind a checksum of all their bytes, so that damage is told before HDF5 follows it.

#include <cstdint>
#include <filesystem>

namespace tissuewarp {

/// Room for the seal: HDF5's user block, which other readers skip.
constexpr std::uint64_t hdf5_seal_bytes = 512;

/// Writes "tissuewarp sha256 …" of the bytes behind it into the user block. Throws IoError.
void seal_hdf5(const std::filesystem::path& path);

/// Throws IoError unless the seal fits the bytes, or, of a file without one as older versions and other programs write
/// them, its structure is sound (hdf5_structure.hpp).
void require_unbroken_hdf5(const std::filesystem::path& path);

}  // namespace tissuewarp
