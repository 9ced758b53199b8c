#include "report/detail/template.hpp"

#include <stdexcept>
#include <vector>

namespace tissuewarp::report::detail {

namespace {

using nlohmann::json;

/// The values from outermost to innermost.
using Scopes = std::vector<const json*>;

const json& look_up(const Scopes& scopes, const std::string& name) {
    static const json nothing;
    if (name == ".") return *scopes.back();
    for (auto scope = scopes.rbegin(); scope != scopes.rend(); ++scope)
        if ((*scope)->is_object() && (*scope)->contains(name)) return (**scope)[name];
    return nothing;
}

bool absent(const json& value) {
    if (value.is_null() || (value.is_boolean() && !value.get<bool>())) return true;
    return (value.is_array() || value.is_object() || value.is_string()) &&
           (value.is_string() ? value.get_ref<const std::string&>().empty() : value.empty());
}

std::string value_text(const json& value) {
    if (value.is_string()) return value.get<std::string>();
    return value.is_null() ? "" : value.dump(-1, ' ', false, json::error_handler_t::replace);
}

/// Where the section opened just before `at` closes: {start, end} of its closing tag.
std::pair<std::size_t, std::size_t> closing_tag(std::string_view page, std::size_t at, const std::string& name) {
    int depth = 1;
    for (std::size_t open = page.find("{{", at); open != std::string_view::npos; open = page.find("{{", open + 2)) {
        const std::size_t close = page.find("}}", open);
        if (close == std::string_view::npos) break;
        const std::string_view tag = page.substr(open + 2, close - open - 2);
        if (tag.substr(1) != name) continue;
        if (tag[0] == '#' || tag[0] == '^') ++depth;
        if (tag[0] == '/' && --depth == 0) return {open, close + 2};
    }
    throw std::logic_error("the page's section '" + name + "' does not close");
}

void fill_into(std::string& result, std::string_view page, Scopes& scopes);

void fill_section(std::string& result, std::string_view body, bool inverted, const json& value, Scopes& scopes) {
    if (inverted || absent(value)) {
        if (inverted == absent(value)) fill_into(result, body, scopes);
        return;
    }
    const auto with = [&](const json& scope) {
        scopes.push_back(&scope);
        fill_into(result, body, scopes);
        scopes.pop_back();
    };
    if (value.is_array())
        for (const json& element : value) with(element);
    else
        with(value);
}

void fill_into(std::string& result, std::string_view page, Scopes& scopes) {
    std::size_t at = 0;
    for (std::size_t open = page.find("{{"); open != std::string_view::npos; open = page.find("{{", at)) {
        result += page.substr(at, open - at);
        const std::size_t close = page.find("}}", open);
        if (close == std::string_view::npos) throw std::logic_error("a tag of the page does not close");
        const std::string tag(page.substr(open + 2, close - open - 2));
        at = close + 2;
        if (tag[0] == '&') {
            result += value_text(look_up(scopes, tag.substr(1)));
            continue;
        }
        if (tag[0] != '#' && tag[0] != '^') {
            result += escaped(value_text(look_up(scopes, tag)));
            continue;
        }
        const std::string name = tag.substr(1);
        const auto [body_end, end] = closing_tag(page, at, name);
        fill_section(result, page.substr(at, body_end - at), tag[0] == '^', look_up(scopes, name), scopes);
        at = end;
    }
    result += page.substr(at);
}

}  // namespace

std::string escaped(std::string_view text) {
    std::string result;
    result.reserve(text.size());
    for (const char c : text) {
        if (c == '&')
            result += "&amp;";
        else if (c == '<')
            result += "&lt;";
        else if (c == '>')
            result += "&gt;";
        else if (c == '"')
            result += "&quot;";
        else if (c == '\'')
            result += "&#39;";
        else
            result += c;
    }
    return result;
}

std::string fill(std::string_view page, const json& values) {
    std::string result;
    Scopes scopes{&values};
    fill_into(result, page, scopes);
    return result;
}

}  // namespace tissuewarp::report::detail
