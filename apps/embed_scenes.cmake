# cmake -DFOLDER=data/scenes -DOUTPUT=x.cpp -P embed_scenes.cmake: writes the scenes as C++ raw strings.
file(GLOB scenes "${FOLDER}/*.toml")
list(SORT scenes)
set(entries "")
foreach(scene IN LISTS scenes)
  get_filename_component(name "${scene}" NAME_WE)
  file(READ "${scene}" text)
  string(APPEND entries "        {\"${name}\", R\"scene(${text})scene\"},\n")
endforeach()
file(WRITE "${OUTPUT}" "#include \"apps/scene_texts.hpp\"

namespace tissuewarp::apps {

const std::vector<SceneText>& scene_texts() {
    static const std::vector<SceneText> texts{
${entries}    };
    return texts;
}

}  // namespace tissuewarp::apps
")
