#pragma once
/// SHA-256 of a file, for provenance.

#include <filesystem>
#include <string>

namespace tissuewarp {

/// Lower-case hexadecimal digest of a regular file's bytes. Throws IoError.
std::string sha256_of_file(const std::filesystem::path& path);

}  // namespace tissuewarp
