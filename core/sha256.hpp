#pragma once
/// SHA-256 of a file, for provenance.

#include <cstdint>
#include <filesystem>
#include <string>

namespace tissuewarp {

/// Lower-case hexadecimal digest of a regular file's bytes, `from` one of them on. Throws IoError.
std::string sha256_of_file(const std::filesystem::path& path, std::uint64_t from = 0);

}  // namespace tissuewarp
