#pragma once
/// Reading TOML with errors of one line that name file and line. Included by few sources: toml++ is heavy.

#include "core/errors.hpp"

#include <toml++/toml.h>

#include <filesystem>
#include <string>

namespace tissuewarp::apps {

/// "file.toml, line 3"
inline std::string toml_place(const std::filesystem::path& path, const toml::node& node) {
    return "'" + path.string() + "', line " + std::to_string(node.source().begin.line);
}

inline toml::table parse_toml_file(const std::filesystem::path& path) {
    std::error_code failure;
    if (!std::filesystem::is_regular_file(path, failure))
        throw IoError("cannot read '" + path.string() + "': no such file");
    try {
        return toml::parse_file(path.string());
    } catch (const toml::parse_error& error) {
        throw InvalidInput("'" + path.string() + "', line " + std::to_string(error.source().begin.line) + ": " +
                           std::string(error.description()));
    }
}

}  // namespace tissuewarp::apps
