#pragma once
/// Parameter files (TOML) turned into command-line arguments.

#include <filesystem>
#include <string>
#include <vector>

namespace tissuewarp::apps {

/// What a verb's configuration may say: its long options without dashes; `switches` take no value.
struct KnownOptions {
    std::vector<std::string> names, switches;
};

/// The file's keys as arguments ("--edge-length", "4"). Throws IoError, and InvalidInput with file, line and the
/// nearest right name for a key that is no option, a table, or a value of a kind that no option takes.
std::vector<std::string> read_config(const std::filesystem::path& path, const KnownOptions& known);

/// Puts the file that --config names in front of the other arguments, which replace what it says of the same option.
std::vector<std::string> with_config(const std::vector<std::string>& arguments, const KnownOptions& known);

}  // namespace tissuewarp::apps
