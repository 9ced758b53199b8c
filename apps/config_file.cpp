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
                               (nearest.empty() ? "; see 'tissuewarp register --help-all'" : "; did you mean '" + nearest + "'?"));
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

/// Of the arguments of a file, those of options that the command line does not give.
std::vector<std::string> not_given(const std::vector<std::string>& from_file, const std::vector<std::string>& given,
                                   const KnownOptions& known) {
    std::vector<std::string> result;
    for (std::size_t i = 0; i < from_file.size(); ++i) {
        const std::string& name = from_file[i];
        const bool is_switch =
            std::find(known.switches.begin(), known.switches.end(), name.substr(2)) != known.switches.end();
        const bool wins = std::any_of(given.begin(), given.end(), [&](const std::string& argument) {
            return argument == name || argument.starts_with(name + "=");
        });
        const std::size_t end = i + (is_switch ? 1 : 2);
        if (!wins) result.insert(result.end(), from_file.begin() + long(i), from_file.begin() + long(end));
        i = end - 1;
    }
    return result;
}

}  // namespace

std::vector<std::string> read_config(const std::filesystem::path& path, const KnownOptions& known) {
    return naming(path, [&] { return read_checked(path, known); });
}

std::vector<std::string> with_config(const std::vector<std::string>& arguments, const KnownOptions& known) {
    std::vector<std::string> expanded{arguments.front()}, from_files, rest;
    for (std::size_t i = 1; i < arguments.size(); ++i) {
        const bool separate = arguments[i] == "--config" && i + 1 < arguments.size();
        if (!separate && !arguments[i].starts_with("--config=")) {
            rest.push_back(arguments[i]);
            continue;
        }
        const auto more = read_config(separate ? arguments[++i] : arguments[i].substr(9), known);
        from_files = not_given(from_files, more, known);  // of two files the later one
        from_files.insert(from_files.end(), more.begin(), more.end());
    }
    from_files = not_given(from_files, rest, known);
    expanded.insert(expanded.end(), from_files.begin(), from_files.end());
    expanded.insert(expanded.end(), rest.begin(), rest.end());
    return expanded;
}

}  // namespace tissuewarp::apps
