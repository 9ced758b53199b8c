#pragma once
/// Scene files (docs/manual/scene-file.md).

#include "core/observer.hpp"
#include "simulation/scene.hpp"

#include <filesystem>
#include <string_view>

namespace tissuewarp::apps {

/// Reads a scene with the files that it names, which it looks for beside itself. Throws IoError, and InvalidInput with
/// file and line for unknown keys, values of the wrong kind or out of range, sets and labels that do not exist; and for
/// what simulation::require_valid() refuses. Notes to the observer: what the readers of images had to decide.
simulation::Scene read_scene(const std::filesystem::path& path, Observer& observer = silent_observer());

/// The same of a text whose files lie in `folder`; messages call it "scene" there.
simulation::Scene scene_of_text(std::string_view text, const std::filesystem::path& folder,
                                Observer& observer = silent_observer());

}  // namespace tissuewarp::apps
