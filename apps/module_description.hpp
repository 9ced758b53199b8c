#pragma once
/// Verbs as command-line modules of 3D Slicer: the description (XML) that its execution model asks for.

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace tissuewarp::apps {

/// What a verb's declaration says of one option.
struct DeclaredOption {
    enum class Type { File, Text, Choice, Integer, Real, Switch, List };
    std::string name;        ///< long, without dashes; of a positional, its name
    std::string short_name;  ///< one letter, or empty
    std::string description, default_text;
    Type type = Type::Text;
    bool positional = false;
    std::vector<std::string> choices;  ///< of Choice
    std::string least, most;           ///< of Integer and Real
};

/// ModuleDescription XML of a verb. 3D Slicer allows no hyphens in long flags: they are underscores, which
/// with_hyphens undoes. Left out is what makes no sense in its panel (a trial run, writing a template).
std::string module_description(const std::string& verb, const std::string& what,
                               const std::vector<DeclaredOption>& options);

/// Arguments whose long options are written with hyphens: `--moving_labels=a_b` becomes `--moving-labels=a_b`.
std::vector<std::string> with_hyphens(std::vector<std::string> arguments);

/// Writes the file of --returnparameterfile, one `name = value` a line; nothing where `path` is empty. Throws IoError.
void write_return_parameters(const std::filesystem::path& path,
                             const std::vector<std::pair<std::string, std::string>>& values);

}  // namespace tissuewarp::apps
