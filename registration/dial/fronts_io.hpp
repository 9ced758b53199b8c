#pragma once
/// Measured fronts as a file of the user, and those that come with the program.

#include "registration/dial/dial.hpp"

#include <filesystem>
#include <string>

namespace tissuewarp::registration {

/// fronts.json as user_cache_file (core/user_cache.hpp) places it; empty where there is no place.
std::filesystem::path fronts_path();

/// JSON of schema "tissuewarp.fronts", docs/manual/calibrate.md.
std::string to_json_text(const Fronts& fronts);

/// Throws InvalidInput, naming `source` and the key, for text that is no such file or holds impossible values.
Fronts fronts_from_json(const std::string& text, const std::string& source);

/// Those measured on this machine where the file of fronts_path() is there, otherwise shipped_fronts(). Throws IoError
/// and InvalidInput for a file that cannot be used.
Fronts known_fronts();

/// Of seven phantoms and seven meshes, on two cores of a Xeon.
Fronts shipped_fronts();

/// Makes the folder and replaces the file at once. Throws IoError.
void write_fronts(const Fronts& fronts, const std::filesystem::path& path);

}  // namespace tissuewarp::registration
