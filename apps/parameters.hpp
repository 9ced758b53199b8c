#pragma once
/// The parameters of a run as names and values: how they are saved, hashed into records and found again.

#include <filesystem>
#include <string>
#include <vector>

namespace tissuewarp::apps {

/// A long option without its dashes, and its values. A list is written as an array.
struct Parameter {
    enum class Kind { Text, Number, Switch, TextList };
    std::string name;
    Kind kind = Kind::Text;
    std::vector<std::string> values;
};

/// TOML with one line per parameter, readable by read_config.
std::string to_toml(const std::vector<Parameter>& parameters);

/// Writes to_toml to a file, complete or absent. Throws IoError.
void save_parameters(const std::vector<Parameter>& parameters, const std::filesystem::path& path);

/// The name in `names` nearest to `word` in edit distance; empty when none is near enough to be meant.
std::string nearest_name(const std::string& word, const std::vector<std::string>& names);

}  // namespace tissuewarp::apps
