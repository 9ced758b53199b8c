// tissuewarp study accuracy-time

#include "apps/study.hpp"
#include "core/errors.hpp"

namespace tissuewarp::apps {

void run_accuracy_time_study(const StudyOptions& options) {
    if (options.output.empty()) throw InvalidInput("give --output, the folder for measurements and page");
}

}  // namespace tissuewarp::apps
