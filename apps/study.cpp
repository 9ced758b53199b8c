// tissuewarp study: measurements over many runs, by name.

#include "apps/study.hpp"

#include "apps/verbs.hpp"
#include "core/errors.hpp"

#include <charconv>
#include <map>

namespace tissuewarp::apps {

void run_study(const StudyOptions& options) {
    static const std::map<std::string, void (*)(const StudyOptions&)> studies{
        {"accuracy-time", run_accuracy_time_study},
        {"coverage", run_coverage_study},
        {"dial", run_dial_study},
        {"patient", run_patient_study}};
    const auto study = studies.find(options.name);
    if (study == studies.end()) {
        std::string names;
        for (const auto& [name, run] : studies) names += (names.empty() ? "" : ", ") + name;
        throw InvalidInput("there is no study '" + options.name + "'; there are: " + names);
    }
    study->second(options);
}

std::pair<std::uint64_t, std::uint64_t> phantom_seeds(const std::vector<std::string>& problems,
                                                      std::pair<std::uint64_t, std::uint64_t> otherwise) {
    if (problems.empty()) return otherwise;
    const std::string& text = problems.front();
    const std::string prefix = "phantom:";
    const char* end = text.data() + text.size();
    const char* at = text.data() + std::min(prefix.size(), text.size());
    std::uint64_t first = 0, last = 0;
    auto read = std::from_chars(at, end, first);
    last = first;
    if (read.ec == std::errc() && read.ptr != end && *read.ptr == '-') read = std::from_chars(read.ptr + 1, end, last);
    if (problems.size() > 1 || !text.starts_with(prefix) || read.ec != std::errc() || read.ptr != end || last < first)
        throw InvalidInput("--problems '" + text + "' are no phantoms; write for instance phantom:7001-7050");
    return {first, last};
}

}  // namespace tissuewarp::apps
