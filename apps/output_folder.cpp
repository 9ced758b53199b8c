#include "apps/output_folder.hpp"

#include "core/atomic_file.hpp"
#include "core/errors.hpp"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <system_error>

namespace tissuewarp::apps {
namespace fs = std::filesystem;

namespace {

/// The folders on the way to `folder` that do not exist, outermost first.
std::vector<fs::path> missing_folders(const fs::path& folder) {
    std::vector<fs::path> missing;
    std::error_code ignored;
    for (fs::path at = fs::absolute(folder).lexically_normal(); !at.empty() && !fs::exists(at, ignored);) {
        if (at.has_filename()) missing.push_back(at);
        const fs::path parent = at.parent_path();
        if (parent == at) break;
        at = parent;
    }
    std::reverse(missing.begin(), missing.end());
    return missing;
}

void remove_created(const std::vector<fs::path>& created) {
    std::error_code ignored;
    for (auto folder = created.rbegin(); folder != created.rend(); ++folder) fs::remove(*folder, ignored);
}

}  // namespace

OutputFolder::OutputFolder(fs::path folder)
    : folder_(std::move(folder)), staging_(folder_ / (".partial-" + std::to_string(::getpid()))) {
    created_ = missing_folders(folder_);
    try {
        require_writable_folder(folder_);
        std::error_code failure;
        fs::create_directory(staging_, failure);
        if (failure) throw IoError("cannot write into the folder '" + folder_.string() + "': " + failure.message());
    } catch (...) {
        remove_created(created_);
        throw;
    }
}

OutputFolder::~OutputFolder() {
    std::error_code ignored;
    fs::remove_all(staging_, ignored);
    if (!committed_) remove_created(created_);
}

std::string OutputFolder::in_words(std::string message) const {
    const std::string hidden = staging_.string();
    for (auto at = message.find(hidden); at != std::string::npos; at = message.find(hidden, at))
        message.replace(at, hidden.size(), folder_.string());
    return message;
}

void OutputFolder::commit() {
    for (const fs::directory_entry& entry : fs::directory_iterator(staging_)) {
        std::error_code failure;
        fs::rename(entry.path(), folder_ / entry.path().filename(), failure);
        if (failure)
            throw IoError("cannot write '" + (folder_ / entry.path().filename()).string() + "': " + failure.message());
    }
    committed_ = true;
}

void require_could_write(const fs::path& folder) {
    fs::path at = fs::absolute(folder).lexically_normal();
    std::error_code ignored;
    while (!fs::exists(at, ignored) && at.has_relative_path()) at = at.parent_path();
    if (!fs::is_directory(at, ignored))
        throw IoError("cannot write into '" + folder.string() + "': '" + at.string() + "' is not a folder");
    if (::access(at.c_str(), W_OK | X_OK) != 0)
        throw IoError("cannot write into '" + folder.string() + "': " + std::strerror(errno));
}

void require_could_write_file(const fs::path& file) {
    const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
    std::error_code ignored;
    if (!fs::is_directory(folder, ignored))
        throw IoError("cannot write '" + file.string() + "': there is no folder '" + folder.string() + "'");
    require_could_write(folder);
}

}  // namespace tissuewarp::apps
