#pragma once
/// Reading TOML with errors of one line that name file and line. Included by few sources: toml++ is heavy.

#include "core/errors.hpp"

#include <toml++/toml.h>

#include <filesystem>
#include <string>
#include <string_view>

namespace tissuewarp::apps {

/// "file.toml, line 3"
inline std::string toml_place(const std::filesystem::path& path, const toml::node& node) {
    return "'" + path.string() + "', line " + std::to_string(node.source().begin.line);
}

/// What `parse()` returns; `path` stands for it in messages.
template <class Parse>
toml::table parsed_toml(const std::filesystem::path& path, const Parse& parse) {
    try {
        return parse();
    } catch (const toml::parse_error& error) {
        throw InvalidInput("'" + path.string() + "', line " + std::to_string(error.source().begin.line) + ": " +
                           std::string(error.description()));
    }
}

inline toml::table parse_toml_file(const std::filesystem::path& path) {
    std::error_code failure;
    if (!std::filesystem::is_regular_file(path, failure))
        throw IoError("cannot read '" + path.string() + "': no such file");
    return parsed_toml(path, [&] { return toml::parse_file(path.string()); });
}

inline toml::table parse_toml(std::string_view text, const std::filesystem::path& path) {
    return parsed_toml(path, [&] { return toml::parse(text); });
}

}  // namespace tissuewarp::apps
