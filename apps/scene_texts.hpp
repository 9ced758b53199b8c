#pragma once
/// The files of data/scenes as texts; the source is made by embed_scenes.cmake.

#include <string>
#include <vector>

namespace tissuewarp::apps {

struct SceneText {
    std::string name, text;
};

const std::vector<SceneText>& scene_texts();

/// The bytes of data/brainshift/preop_labels.nii.gz, which the brain's scene is of.
std::string brain_labels();

}  // namespace tissuewarp::apps
