#pragma once
/// What accuracy costs in time: every setting of the plan on every problem, into a folder.

#include "study/plan.hpp"
#include "study/store.hpp"

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace tissuewarp::study {

/// A problem that is made when its turn comes.
struct NamedProblem {
    std::string name;
    std::function<std::unique_ptr<Problem>(Observer&)> make;
};

struct AccuracyTimeOptions {
    PlanOptions plan;
    int runs = 5;
};

/// Called before each point: its words, and how much of all work is done before and after it, 0 … 1.
using PointListener = std::function<void(const std::string& words, double from, double to)>;

/// Measures what the store does not hold yet. Notes failures to the observer. Throws InvalidInput, GpuUnavailable,
/// IoError, Cancelled; what was measured until then stays in the store.
void measure_accuracy_time(const std::vector<NamedProblem>& problems, const AccuracyTimeOptions& options, Store& store,
                           const PointListener& listener, Observer& observer);

}  // namespace tissuewarp::study
