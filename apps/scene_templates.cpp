#include "apps/scene_templates.hpp"

#include "apps/parameters.hpp"
#include "apps/scene_texts.hpp"
#include "core/errors.hpp"

namespace tissuewarp::apps {

namespace {

constexpr const char* brain_in_source = "../brainshift/preop_labels.nii.gz";
constexpr const char* brain_from_here = "data/brainshift/preop_labels.nii.gz";

std::string with_brain(std::string text, const std::filesystem::path& folder) {
    const auto at = text.find(brain_in_source);
    std::error_code failure;
    if (at == std::string::npos || !std::filesystem::is_regular_file(brain_from_here, failure)) return text;
    const std::filesystem::path found = std::filesystem::relative(brain_from_here, folder.empty() ? "." : folder);
    return text.replace(at, std::string(brain_in_source).size(), found.string());
}

}  // namespace

std::vector<std::string> scene_template_names() {
    std::vector<std::string> names;
    for (const SceneText& scene : scene_texts()) names.emplace_back(scene.name);
    return names;
}

std::string scene_template(const std::string& name, const std::filesystem::path& folder) {
    for (const SceneText& scene : scene_texts())
        if (scene.name == name) return with_brain(scene.text, folder);
    const std::string nearest = nearest_name(name, scene_template_names());
    std::string names;
    for (const std::string& each : scene_template_names()) names += (names.empty() ? "" : ", ") + each;
    throw InvalidInput("there is no scene '" + name + "' to begin with; give one of " + names +
                       (nearest.empty() ? "" : " (did you mean '" + nearest + "'?)"));
}

}  // namespace tissuewarp::apps
