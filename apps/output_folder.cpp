#include "apps/output_folder.hpp"

#include "apps/output_commit.hpp"
#include "core/atomic_file.hpp"
#include "core/errors.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
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

void require_no_folder_in_the_way(const fs::path& folder, const IsResult& is_result) {
    std::error_code ignored;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder, ignored))
        if (is_result(entry.path().filename().string()) && entry.is_directory(ignored))
            throw IoError("cannot write '" + entry.path().string() +
                          "': it is a folder; move it away or choose another --output");
}

std::string run_number() {
    return std::to_string(::getpid());
}

/// A commit takes milliseconds: whoever asks the program to stop is too late.
class SignalsWait {
public:
    SignalsWait() {
        for (std::size_t s = 0; s < signals.size(); ++s) before_[s] = std::signal(signals[s], SIG_IGN);
    }
    ~SignalsWait() {
        for (std::size_t s = 0; s < signals.size(); ++s) std::signal(signals[s], before_[s]);
    }
    SignalsWait(const SignalsWait&) = delete;
    SignalsWait& operator=(const SignalsWait&) = delete;

private:
    static constexpr std::array<int, 3> signals{SIGINT, SIGTERM, SIGHUP};
    std::array<void (*)(int), 3> before_{};
};

}  // namespace

OutputFolder::OutputFolder(fs::path folder, IsResult is_result)
    : folder_(std::move(folder)), is_result_(std::move(is_result)) {
    if (folder_.empty()) throw InvalidInput("the output folder has no name; give one by --output");
    created_ = missing_folders(folder_);
    try {
        require_writable_folder(folder_);
        sweep(folder_, is_result_);
        require_no_folder_in_the_way(folder_, is_result_);
        make_staging();
    } catch (...) {
        remove_created(created_);
        throw;
    }
}

OutputFolder::~OutputFolder() {
    std::error_code ignored;
    if (!committed_) fs::remove_all(staging_, ignored);
    if (lock_ >= 0) ::close(lock_);
    if (!committed_) remove_created(created_);
}

void OutputFolder::make_staging() {
    staging_ = hidden_folders(folder_, run_number()).partial;
    std::error_code failure;
    fs::create_directory(staging_, failure);
    if (failure) throw IoError("cannot write into the folder '" + folder_.string() + "': " + failure.message());
    lock_ = lock_folder(staging_);  // a file system without locks is used without them
}

std::string OutputFolder::in_words(std::string message) const {
    const std::string hidden = staging_.string();
    for (auto at = message.find(hidden); at != std::string::npos; at = message.find(hidden, at))
        message.replace(at, hidden.size(), folder_.string());
    return message;
}

void OutputFolder::commit() {
    const SignalsWait wait;
    require_no_folder_in_the_way(folder_, is_result_);
    const HiddenFolders hidden = hidden_folders(folder_, run_number());
    std::error_code failure;
    fs::rename(staging_, hidden.complete, failure);
    if (failure) throw IoError("cannot write into the folder '" + folder_.string() + "': " + failure.message());
    staging_ = hidden.complete;  // to be removed where the old results cannot be moved away
    finish_commit(folder_, run_number(), is_result_);
    committed_ = true;
}

void require_could_write(const fs::path& folder, const IsResult& is_result) {
    fs::path at = fs::absolute(folder).lexically_normal();
    std::error_code ignored;
    while (!fs::exists(at, ignored) && at.has_relative_path()) at = at.parent_path();
    if (!fs::is_directory(at, ignored))
        throw IoError("cannot write into '" + folder.string() + "': '" + at.string() + "' is not a folder");
    if (::access(at.c_str(), W_OK | X_OK) != 0)
        throw IoError("cannot write into '" + folder.string() + "': " + std::strerror(errno));
    require_no_folder_in_the_way(folder, is_result);
}

void require_could_write_file(const fs::path& file) {
    const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
    std::error_code ignored;
    if (!fs::is_directory(folder, ignored))
        throw IoError("cannot write '" + file.string() + "': there is no folder '" + folder.string() + "'");
    if (fs::is_directory(file, ignored))
        throw IoError("cannot write '" + file.string() + "': it is a folder; give the name of a file");
    require_could_write(folder, [](const std::string&) { return false; });
    remove_left_temporaries(file);
}

}  // namespace tissuewarp::apps
