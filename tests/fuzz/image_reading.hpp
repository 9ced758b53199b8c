#pragma once
/// Images of every format are read alike.

#include "tests/fuzz/digest.hpp"

#include <filesystem>

namespace tissuewarp::fuzz {

/// As a volume, and what it is as a label map.
void read_image(const std::filesystem::path& path, Digest& digest);

}  // namespace tissuewarp::fuzz
