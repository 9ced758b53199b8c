#pragma once
/// A folder of results that appears complete or not at all.

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace tissuewarp::apps {

/// Whether a file of this name is one that a verb leaves in its output folder, whatever its options.
using IsResult = std::function<bool(const std::string&)>;

/// Files are written into a hidden folder beside their destination and moved there by commit(), which takes away what
/// an older run left: no file of one run stands beside a report of another. Without a commit the destructor removes
/// what was written, and every folder that was created on the way. Where a process is killed, the next run in the same
/// folder sweeps its hidden folders, and completes a commit that had begun.
class OutputFolder {
public:
    /// Throws IoError when the folder cannot be created or written, and where a folder has the name of a result.
    explicit OutputFolder(std::filesystem::path folder, IsResult is_result);
    ~OutputFolder();
    OutputFolder(const OutputFolder&) = delete;
    OutputFolder& operator=(const OutputFolder&) = delete;

    /// Where to write a result for now.
    [[nodiscard]] std::filesystem::path path(const std::string& name) const { return staging_ / name; }
    [[nodiscard]] const std::filesystem::path& staging() const { return staging_; }
    [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }

    /// A message that names the folder the user asked for in place of the hidden one.
    [[nodiscard]] std::string in_words(std::string message) const;

    /// Moves every file to its place and removes the other results of older runs. Signals that ask to stop have to
    /// wait. Throws IoError.
    void commit();

private:
    std::filesystem::path folder_, staging_;
    IsResult is_result_;
    std::vector<std::filesystem::path> created_;  // outermost first
    int lock_ = -1;
    bool committed_ = false;

    void make_staging();
};

/// Throws IoError unless results could be written to `folder`, which need not exist; creates nothing.
void require_could_write(const std::filesystem::path& folder, const IsResult& is_result);

/// The same for a single file, whose folder must exist; removes what killed processes left of it.
void require_could_write_file(const std::filesystem::path& file);

}  // namespace tissuewarp::apps
