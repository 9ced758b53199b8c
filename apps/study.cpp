// tissuewarp study: measurements over many runs, by name.

#include "apps/study.hpp"

#include "apps/verbs.hpp"
#include "core/errors.hpp"

#include <map>

namespace tissuewarp::apps {

void run_study(const StudyOptions& options) {
    static const std::map<std::string, void (*)(const StudyOptions&)> studies{
        {"accuracy-time", run_accuracy_time_study}, {"dial", run_dial_study}};
    const auto study = studies.find(options.name);
    if (study == studies.end()) {
        std::string names;
        for (const auto& [name, run] : studies) names += (names.empty() ? "" : ", ") + name;
        throw InvalidInput("there is no study '" + options.name + "'; there are: " + names);
    }
    study->second(options);
}

}  // namespace tissuewarp::apps
