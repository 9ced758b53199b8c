#pragma once
/// Commented scenes that run: the files of data/scenes, which are part of the program.

#include <filesystem>
#include <string>
#include <vector>

namespace tissuewarp::apps {

/// "brain-shift", "breast", "cube", …
std::vector<std::string> scene_template_names();

/// The text for a scene file in `folder`. The label map of the brain is named from there where data/brainshift lies
/// beside the present folder. Throws InvalidInput for an unknown name, with the nearest one.
std::string scene_template(const std::string& name, const std::filesystem::path& folder);

}  // namespace tissuewarp::apps
