# cmake -DROOT=dir -DFILES=a|b -DOUTPUT=x.cpp -P embed_glsl.cmake: writes GLSL files as C++ raw strings, named relative
# to ROOT.
string(REPLACE "|" ";" FILES "${FILES}")
set(entries "")
foreach(path IN LISTS FILES)
  file(READ "${path}" text)
  file(RELATIVE_PATH name "${ROOT}" "${path}")
  string(APPEND entries "        {\"${name}\", R\"glsl(${text})glsl\"},\n")
endforeach()
file(WRITE "${OUTPUT}" "#include \"shaders/program_source.hpp\"

namespace tissuewarp::shaders {

const SourceLibrary& embedded_sources() {
    static const SourceLibrary sources{
${entries}    };
    return sources;
}

}  // namespace tissuewarp::shaders
")
