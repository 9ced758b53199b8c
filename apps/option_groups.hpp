#pragma once
/// How the help of verbs with many options is arranged: what people need first, and the rest by purpose.

#include <string>
#include <vector>

namespace tissuewarp::apps {

struct OptionGroup {
    std::string name;                  ///< a heading
    std::vector<std::string> options;  ///< long names with their dashes
};

struct HelpLayout {
    std::vector<std::string> first;   ///< what --help shows; empty: everything
    std::vector<OptionGroup> groups;  ///< headings of --help-all; options of none stand under "Options"
};

/// Of a verb; empty of verbs whose options fit on a screen.
HelpLayout help_layout(const std::string& verb);

}  // namespace tissuewarp::apps
