#pragma once
/// Filling the page's template with values: the words are the template's, the values the program's.

#include <nlohmann/json.hpp>

#include <string>
#include <string_view>

namespace tissuewarp::report::detail {

/// report/page.html, embedded at build time.
const char* page_template();

/// The part of Mustache (mustache(5)) that pages use: {{name}} is the value with the characters of HTML escaped,
/// {{&name}} the value as it is,
/// {{.}} the present element; {{#name}}…{{/name}} repeats for each element of a list, enters an object, and stays for
/// any other value but false, null and empty ones; {{^name}}…{{/name}} stays for those. Names not found inside are
/// looked up outside. Values are texts or numbers. Throws std::logic_error on a template whose sections do not close.
std::string fill(std::string_view page, const nlohmann::json& values);

/// & < > " ' as entities.
std::string escaped(std::string_view text);

}  // namespace tissuewarp::report::detail
