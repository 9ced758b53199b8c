# cmake -DFOLDER=data/scenes -DLABELS=x.nii.gz -DOUTPUT=x.cpp -P embed_scenes.cmake: writes the scenes as C++ raw strings,
# and the label map that one of them is of as bytes.
file(GLOB scenes "${FOLDER}/*.toml")
list(SORT scenes)
set(entries "")
foreach(scene IN LISTS scenes)
  get_filename_component(name "${scene}" NAME_WE)
  file(READ "${scene}" text)
  string(APPEND entries "        {\"${name}\", R\"scene(${text})scene\"},\n")
endforeach()
file(READ "${LABELS}" bytes HEX)
string(REGEX REPLACE "(..)" "0x\\1," bytes "${bytes}")
file(WRITE "${OUTPUT}" "#include \"apps/scene_texts.hpp\"

namespace tissuewarp::apps {
namespace {

constexpr unsigned char labels_of_brain[] = {${bytes}};

}  // namespace

const std::vector<SceneText>& scene_texts() {
    static const std::vector<SceneText> texts{
${entries}    };
    return texts;
}

std::string brain_labels() {
    return {reinterpret_cast<const char*>(labels_of_brain), sizeof labels_of_brain};
}

}  // namespace tissuewarp::apps
")
