# cmake -DPAGE=page.html -DOUTPUT=x.cpp -DNAMESPACE=a::b -P embed_page.cmake: writes the page as a C++ raw string,
# `const char* page_template()` of that namespace. A line "@include viewer/name@" becomes that file beside the page.
file(READ "${PAGE}" text)
get_filename_component(folder "${PAGE}" DIRECTORY)
string(REGEX MATCHALL "@include [a-z_/.]+@" includes "${text}")
foreach(include IN LISTS includes)
  string(REGEX REPLACE "@include (.*)@" "\\1" name "${include}")
  file(READ "${folder}/${name}" part)
  string(REPLACE "${include}" "${part}" text "${text}")
endforeach()
file(WRITE "${OUTPUT}" "namespace ${NAMESPACE} {

const char* page_template();
const char* page_template() {
    return R\"page(${text})page\";
}

}  // namespace ${NAMESPACE}
")
