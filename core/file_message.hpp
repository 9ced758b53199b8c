#pragma once
/// Messages about files name them and can be shown, whatever the files hold.

#include "core/errors.hpp"

#include <filesystem>
#include <string>

namespace tissuewarp {

/// Fit for a terminal: what is no printable character is '?', and of more than 1000 bytes the middle is left out, so
/// that the file's name and the remedy stay.
std::string presentable(std::string message);

/// The message, presentable, behind the file's name unless it holds it.
std::string message_naming(const std::filesystem::path& path, const std::string& message);

/// What `read()` returns. Messages of checks that know no files get the file's name, and those that quote it are cut.
template <class Read>
auto naming(const std::filesystem::path& path, const Read& read) {
    try {
        return read();
    } catch (const InvalidInput& problem) {
        throw InvalidInput(message_naming(path, problem.what()));
    } catch (const IoError& problem) {
        throw IoError(message_naming(path, problem.what()));
    }
}

}  // namespace tissuewarp
