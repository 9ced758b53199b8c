#include "apps/scene_templates.hpp"

#include "apps/parameters.hpp"
#include "apps/scene_texts.hpp"
#include "core/errors.hpp"

#include <string_view>

namespace tissuewarp::apps {

namespace {

constexpr std::string_view brain_in_source = "../brainshift/preop_labels.nii.gz";

SceneTemplate with_labels(std::string text, const std::string& labels_name) {
    const auto at = text.find(brain_in_source);
    if (at == std::string::npos) return {std::move(text), {}};
    return {text.replace(at, brain_in_source.size(), labels_name), brain_labels()};
}

}  // namespace

std::vector<std::string> scene_template_names() {
    std::vector<std::string> names;
    for (const SceneText& scene : scene_texts()) names.emplace_back(scene.name);
    return names;
}

SceneTemplate scene_template(const std::string& name, const std::string& labels_name) {
    for (const SceneText& scene : scene_texts())
        if (scene.name == name) return with_labels(scene.text, labels_name);
    const std::string nearest = nearest_name(name, scene_template_names());
    std::string names;
    for (const std::string& each : scene_template_names()) names += (names.empty() ? "" : ", ") + each;
    throw InvalidInput("there is no scene '" + name + "' to begin with; give one of " + names +
                       (nearest.empty() ? "" : " (did you mean '" + nearest + "'?)"));
}

}  // namespace tissuewarp::apps
