# cmake -DPAGE=page.html -DOUTPUT=x.cpp -P embed_page.cmake: writes the page as a C++ raw string.
file(READ "${PAGE}" text)
file(WRITE "${OUTPUT}" "#include \"report/detail/template.hpp\"

namespace tissuewarp::report::detail {

const char* page_template() {
    return R\"page(${text})page\";
}

}  // namespace tissuewarp::report::detail
")
