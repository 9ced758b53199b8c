#include "study/accuracy_time.hpp"

#include <numeric>

namespace tissuewarp::study {

namespace {

/// For the percent alone: larger meshes take longer, the smallest not nothing.
double work_of(const Setting& setting, bool prepared) {
    const double thousands = 1 + setting.elements / 1000.0;
    return prepared ? thousands : 4 * thousands;
}

/// Progress and interrupts without the solvers' notes, which every run would repeat.
class WithoutNotes final : public Observer {
public:
    explicit WithoutNotes(Observer& observer) : observer_(observer) {}
    void progress(std::string_view stage, double fraction) override { observer_.progress(stage, fraction); }
    bool cancel_requested() override { return observer_.cancel_requested(); }

private:
    Observer& observer_;
};

/// What of a problem is left to do, with the work that it is.
struct Left {
    std::vector<Setting> settings;
    std::vector<double> work;
};

Left left_of(const Problem& problem, const PlanOptions& options, const Store& store) {
    Left left;
    for (const Setting& setting : plan(problem, options)) {
        if (store.holds(problem.name(), setting)) continue;
        const bool prepared = !left.settings.empty() && left.settings.back().elements == setting.elements &&
                              left.settings.back().element == setting.element &&
                              left.settings.back().physics == setting.physics;
        left.settings.push_back(setting);
        left.work.push_back(work_of(setting, prepared));
    }
    return left;
}

}  // namespace

void measure_accuracy_time(const std::vector<NamedProblem>& problems, const AccuracyTimeOptions& options, Store& store,
                           const PointListener& listener, Observer& observer) {
    WithoutNotes quiet(observer);
    for (std::size_t p = 0; p < problems.size(); ++p) {
        const double from = double(p) / double(problems.size()), share = 1.0 / double(problems.size());
        constexpr double making = 0.02;  // of the problem's share
        listener(problems[p].name, from, from + making * share);
        const std::unique_ptr<Problem> problem = problems[p].make(quiet);
        store.describe(
            {problem->name(), problem->story(), base_of(*problem, options.plan), problem->is_registration()});
        const Left left = left_of(*problem, options.plan, store);
        const double all = std::accumulate(left.work.begin(), left.work.end(), 0.0);
        double done = 0;
        for (std::size_t i = 0; i < left.settings.size(); ++i) {
            const auto at = [&](double work) { return from + share * (making + (1 - making) * work / all); };
            listener(problem->name() + " " + words_of(left.settings[i]), at(done), at(done + left.work[i]));
            done += left.work[i];
            Point point = problem->measure(left.settings[i], options.runs, quiet);
            if (!point.solved()) observer.note(point.problem + ", " + words_of(point.setting) + ": " + point.failure);
            store.add(std::move(point));
        }
    }
}

}  // namespace tissuewarp::study
