# cmake -DPAGE=page.html -DOUTPUT=x.cpp -DNAMESPACE=a::b -P embed_page.cmake: writes the page as a C++ raw string,
# `const char* page_template()` of that namespace.
file(READ "${PAGE}" text)
file(WRITE "${OUTPUT}" "namespace ${NAMESPACE} {

const char* page_template();
const char* page_template() {
    return R\"page(${text})page\";
}

}  // namespace ${NAMESPACE}
")
