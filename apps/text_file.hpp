#pragma once
/// Small text files that appear complete or not at all.

#include "core/atomic_file.hpp"
#include "core/errors.hpp"

#include <filesystem>
#include <fstream>
#include <string>

namespace tissuewarp::apps {

/// Throws IoError (missing folder, permission, full disk).
inline void write_text(const std::string& text, const std::filesystem::path& path) {
    AtomicFile file(path);
    std::ofstream stream(file.path(), std::ios::binary);
    stream << text;
    stream.close();
    if (!stream)
        throw IoError("cannot write '" + path.string() + "'; check that the folder exists and the disk has room");
    file.commit();
}

}  // namespace tissuewarp::apps
