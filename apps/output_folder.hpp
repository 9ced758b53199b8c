#pragma once
/// A folder of results that appears complete or not at all.

#include <filesystem>
#include <string>
#include <vector>

namespace tissuewarp::apps {

/// Files are written into a hidden folder beside their destination and moved there by commit(). Without a commit the
/// destructor removes what was written, and every folder that was created on the way.
class OutputFolder {
public:
    /// Throws IoError when the folder cannot be created or written.
    explicit OutputFolder(std::filesystem::path folder);
    ~OutputFolder();
    OutputFolder(const OutputFolder&) = delete;
    OutputFolder& operator=(const OutputFolder&) = delete;

    /// Where to write a result for now.
    [[nodiscard]] std::filesystem::path path(const std::string& name) const { return staging_ / name; }
    [[nodiscard]] const std::filesystem::path& staging() const { return staging_; }
    [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }

    /// A message that names the folder the user asked for in place of the hidden one.
    [[nodiscard]] std::string in_words(std::string message) const;

    /// Moves every file to its place, over files of the same name. Throws IoError.
    void commit();

private:
    std::filesystem::path folder_, staging_;
    std::vector<std::filesystem::path> created_;  // outermost first
    bool committed_ = false;
};

/// Throws IoError unless files could be written to `folder`, which need not exist; creates nothing.
void require_could_write(const std::filesystem::path& folder);

/// The same for a single file, whose folder must exist.
void require_could_write_file(const std::filesystem::path& file);

}  // namespace tissuewarp::apps
