#pragma once
/// Files that appear complete or not at all.

#include <filesystem>
#include <string_view>

namespace tissuewarp {

/// A temporary name beside the destination. Write to `path()`, then `commit()` renames it over the destination; without
/// a commit the destructor removes it. The temporary keeps the destination's extension, which image libraries read.
class AtomicFile {
public:
    explicit AtomicFile(std::filesystem::path destination);
    ~AtomicFile();
    AtomicFile(const AtomicFile&) = delete;
    AtomicFile& operator=(const AtomicFile&) = delete;

    [[nodiscard]] const std::filesystem::path& path() const { return temporary_; }

    /// Flushes the file to disk and renames it. Throws IoError (full disk, missing folder, permission).
    void commit();

private:
    std::filesystem::path destination_, temporary_;
    bool committed_ = false;
};

/// Removes temporaries of this destination that processes left which were killed.
void remove_left_temporaries(const std::filesystem::path& destination);

/// A file of these bytes. Throws IoError (full disk, missing folder, permission).
void write_file(std::string_view bytes, const std::filesystem::path& path);

/// Throws IoError unless a file can be created in `folder`, which is made when missing.
void require_writable_folder(const std::filesystem::path& folder);

}  // namespace tissuewarp
