#pragma once
/// Commented scenes that run: the files of data/scenes, which are part of the program.

#include <string>
#include <vector>

namespace tissuewarp::apps {

/// "brain-shift", "breast", "cube", …
std::vector<std::string> scene_template_names();

struct SceneTemplate {
    std::string text;    ///< of the scene file
    std::string labels;  ///< bytes of the label map that it names, to lie beside it; empty: it names none
};

/// Its label map is to be called `labels_name`. Throws InvalidInput for an unknown name, with the nearest one.
SceneTemplate scene_template(const std::string& name, const std::string& labels_name);

}  // namespace tissuewarp::apps
