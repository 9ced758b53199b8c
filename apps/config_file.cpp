#include "apps/config_file.hpp"

#include "apps/parameters.hpp"
#include "apps/toml_file.hpp"
#include "core/file_message.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace tissuewarp::apps {

namespace {

bool contains(const std::vector<std::string>& names, std::string_view name) {
    return std::find(names.begin(), names.end(), name) != names.end();
}

std::string value_text(const toml::node& node, const std::string& place) {
    if (const auto* text = node.as_string()) return text->get();
    if (const auto* number = node.as_integer()) return std::to_string(number->get());
    if (const auto* real = node.as_floating_point()) return fmt::format("{}", real->get());  // shortest that reads back
    throw InvalidInput(place + ": the value must be a number, a text, true, false or a list of texts");
}

void append_switch(const std::string& name, const toml::node& node, const std::string& place,
                   std::vector<std::string>& arguments) {
    const auto* on = node.as_boolean();
    if (!on) throw InvalidInput(place + ": '" + name + "' is a switch; write true or false");
    if (on->get()) arguments.push_back("--" + name);
}

std::vector<std::string> read_checked(const std::filesystem::path& path, const KnownOptions& known) {
    const toml::table table = parse_toml_file(path);
    std::vector<std::string> arguments;
    for (const auto& [key, node] : table) {
        const std::string name(key.str());
        const std::string place = toml_place(path, node);
        if (!contains(known.names, name)) {
            const std::string nearest = nearest_name(name, known.names);
            throw InvalidInput(place + ": unknown key '" + name + "'" +
                               (nearest.empty() ? "; see --help for the names" : "; did you mean '" + nearest + "'?"));
        }
        if (contains(known.switches, name)) {
            append_switch(name, node, place, arguments);
        } else if (const auto* list = node.as_array()) {
            for (const toml::node& entry : *list) {
                arguments.push_back("--" + name);
                arguments.push_back(value_text(entry, place));
            }
        } else {
            arguments.push_back("--" + name);
            arguments.push_back(value_text(node, place));
        }
    }
    return arguments;
}

}  // namespace

std::vector<std::string> read_config(const std::filesystem::path& path, const KnownOptions& known) {
    return naming(path, [&] { return read_checked(path, known); });
}

}  // namespace tissuewarp::apps
