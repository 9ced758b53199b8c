#include "core/atomic_file.hpp"

#include "core/errors.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <string>
#include <system_error>
#include <utility>

namespace tissuewarp {
namespace fs = std::filesystem;

namespace {

/// ".nii.gz" counts as one extension: readers look at both parts.
std::string full_extension(const fs::path& path) {
    const std::string last = path.extension().string();
    if (last != ".gz") return last;
    return path.stem().extension().string() + last;
}

/// What stands before and behind the number of the process in the name of a temporary.
std::pair<std::string, std::string> around_number(const fs::path& destination) {
    const std::string name = destination.filename().string(), extension = full_extension(destination);
    return {std::string(".").append(name, 0, name.size() - extension.size()) + ".partial-", extension};
}

fs::path temporary_name(const fs::path& destination) {
    const auto [before, behind] = around_number(destination);
    return destination.parent_path() / (before + std::to_string(::getpid()) + behind);
}

bool lives(const std::string& process) {
    return process.size() > 9 || ::kill(std::atoi(process.c_str()), 0) == 0 || errno != ESRCH;
}

}  // namespace

AtomicFile::AtomicFile(fs::path destination)
    : destination_(std::move(destination)), temporary_(temporary_name(destination_)) {}

AtomicFile::~AtomicFile() {
    if (committed_) return;
    std::error_code ignored;
    fs::remove(temporary_, ignored);
}

void AtomicFile::commit() {
    const int descriptor = ::open(temporary_.c_str(), O_RDONLY);
    if (descriptor < 0) throw IoError("cannot write '" + destination_.string() + "': " + std::strerror(errno));
    const bool flushed = ::fsync(descriptor) == 0;
    const int cause = errno;
    ::close(descriptor);
    if (!flushed) throw IoError("cannot write '" + destination_.string() + "': " + std::strerror(cause));
    std::error_code failure;
    fs::rename(temporary_, destination_, failure);
    if (failure) throw IoError("cannot write '" + destination_.string() + "': " + failure.message());
    committed_ = true;
}

void remove_left_temporaries(const fs::path& destination) {
    const auto [before, behind] = around_number(destination);
    const fs::path folder = destination.has_parent_path() ? destination.parent_path() : fs::path(".");
    std::error_code ignored;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder, ignored)) {
        const std::string name = entry.path().filename().string();
        if (name.size() <= before.size() + behind.size() || !name.starts_with(before) || !name.ends_with(behind))
            continue;
        const std::string number = name.substr(before.size(), name.size() - before.size() - behind.size());
        if (number.find_first_not_of("0123456789") == std::string::npos && !lives(number))
            fs::remove(entry.path(), ignored);
    }
}

void write_file(std::string_view bytes, const fs::path& path) {
    AtomicFile file(path);
    std::ofstream stream(file.path(), std::ios::binary);
    stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    stream.close();
    if (!stream) throw IoError("cannot write '" + path.string() + "'; check the folder, the permission and the space");
    file.commit();
}

void require_writable_folder(const fs::path& folder) {
    std::error_code failure;
    fs::create_directories(folder, failure);
    if (failure) throw IoError("cannot create the folder '" + folder.string() + "': " + failure.message());
    const fs::path probe = folder / (".writable-" + std::to_string(::getpid()));
    const int descriptor = ::open(probe.c_str(), O_WRONLY | O_CREAT | O_EXCL, 0600);
    if (descriptor < 0)
        throw IoError("cannot write into the folder '" + folder.string() + "': " + std::strerror(errno) +
                      "; choose another --output");
    ::close(descriptor);
    ::unlink(probe.c_str());
}

}  // namespace tissuewarp
