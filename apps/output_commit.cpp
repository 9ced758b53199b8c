#include "apps/output_commit.hpp"

#include "core/errors.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <set>
#include <system_error>

namespace tissuewarp::apps {
namespace fs = std::filesystem;

namespace {

void rename_or_throw(const fs::path& from, const fs::path& to) {
    std::error_code failure;
    fs::rename(from, to, failure);
    if (failure) throw IoError("cannot write '" + to.string() + "': " + failure.message());
}

std::vector<std::string> names_in(const fs::path& folder) {
    std::vector<std::string> names;
    std::error_code ignored;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder, ignored))
        names.push_back(entry.path().filename().string());
    return names;
}

/// All or none: where one cannot be moved, those before it go back.
void move_old_away(const fs::path& folder, const fs::path& complete, const fs::path& old, const IsResult& is_result) {
    const std::vector<std::string> coming = names_in(complete);
    const std::set<std::string> replaced(coming.begin(), coming.end());
    std::error_code ignored;
    fs::create_directory(old, ignored);
    std::vector<std::string> moved;
    try {
        for (const std::string& name : names_in(folder)) {
            if (!is_result(name) && !replaced.contains(name)) continue;
            rename_or_throw(folder / name, old / name);
            moved.push_back(name);
        }
    } catch (...) {
        for (const std::string& name : moved) fs::rename(old / name, folder / name, ignored);
        throw;
    }
}

/// "4711" of ".partial-4711"; empty for names of anything else.
std::string run_of(const std::string& name) {
    for (const std::string prefix : {".partial-", ".complete-", ".ready-", ".old-", ".writable-"}) {
        if (!name.starts_with(prefix) || name.size() == prefix.size()) continue;
        const std::string run = name.substr(prefix.size());
        if (run.find_first_not_of("0123456789") == std::string::npos) return run;
    }
    return "";
}

/// Whether a process holds one of the hidden folders of a run.
bool lives(const HiddenFolders& hidden) {
    std::error_code ignored;
    for (const fs::path& folder : {hidden.partial, hidden.complete, hidden.ready}) {
        if (!fs::exists(folder, ignored)) continue;
        const int lock = lock_folder(folder);
        if (lock < 0) return true;
        ::close(lock);
    }
    return false;
}

}  // namespace

HiddenFolders hidden_folders(const fs::path& folder, const std::string& run) {
    return {folder / (".partial-" + run), folder / (".complete-" + run), folder / (".ready-" + run),
            folder / (".old-" + run)};
}

void finish_commit(const fs::path& folder, const std::string& run, const IsResult& is_result) {
    const HiddenFolders hidden = hidden_folders(folder, run);
    std::error_code failure;
    if (fs::exists(hidden.complete, failure)) {
        move_old_away(folder, hidden.complete, hidden.old, is_result);
        rename_or_throw(hidden.complete, hidden.ready);
    }
    if (!fs::exists(hidden.ready, failure)) return;
    for (const std::string& name : names_in(hidden.ready)) rename_or_throw(hidden.ready / name, folder / name);
    fs::remove_all(hidden.ready, failure);
    fs::remove_all(hidden.old, failure);
}

void sweep(const fs::path& folder, const IsResult& is_result) {
    std::set<std::string> runs;
    for (const std::string& name : names_in(folder))
        if (const std::string run = run_of(name); !run.empty()) runs.insert(run);
    for (const std::string& run : runs) {
        const HiddenFolders hidden = hidden_folders(folder, run);
        if (lives(hidden)) continue;
        finish_commit(folder, run, is_result);
        std::error_code ignored;
        for (const fs::path& left : {hidden.partial, hidden.old, folder / (".writable-" + run)})
            fs::remove_all(left, ignored);
    }
}

int lock_folder(const fs::path& folder) {
    const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (descriptor < 0 || ::flock(descriptor, LOCK_EX | LOCK_NB) == 0) return descriptor;
    ::close(descriptor);
    return -1;
}

}  // namespace tissuewarp::apps
