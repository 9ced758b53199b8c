#include "study/dial_trial.hpp"

#include "core/errors.hpp"
#include "registration/field.hpp"
#include "registration/uncertainty.hpp"
#include "registration/warp.hpp"
#include "study/detail/registered_phantom.hpp"

#include <chrono>
#include <string>

namespace tissuewarp::study {

using namespace registration;

namespace {

DialCase case_of(const Phantom& phantom, DataKind kind) {
    const double fixed = detail::megavoxels(phantom.fixed_labels.geometry);
    return {kind, organ_size(phantom.moving_labels), detail::megavoxels(phantom.moving_labels.geometry), fixed,
            kind == DataKind::Labels ? fixed : 0.0};
}

DialTrial tried(const Phantom& phantom, DataKind kind, const DialRequest& request, const Fronts& fronts,
                UpdateOptions update) {
    const DialChoice choice = choose(fronts, request, case_of(phantom, kind));
    PrepareOptions options;
    options.meshing.edge_length = choice.edge_length_mm;
    const auto model = std::make_shared<PreparedModel>(prepare(phantom.moving_labels, options));
    const PreparedModel& prepared = *model;
    prepare_loads(*model);
    const imaging::Volume image = phantom.moving_labels.as(CV_32F);
    update.time_budget_s = choice.update_budget_s;
    Updater updater(model, update);

    const auto begin = std::chrono::steady_clock::now();
    const UpdateResult result = updater.update(detail::seen_of(phantom, kind));
    displacement_moving_to_fixed(result.deformation, phantom.moving_labels.geometry);
    const imaging::Volume backward = displacement_fixed_to_moving(result.deformation, phantom.fixed_labels.geometry);
    warp_image(image, backward);
    warp_labels(phantom.moving_labels, backward);
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;

    DialTrial trial{phantom.seed, kind, request, choice.edge_length_mm, choice.seconds, taken.count()};
    trial.error_mm = detail::root_mean_square_error(result.deformation, phantom.targets);
    const UncertaintySummary estimate = summarise(uncertainty(prepared, result));
    trial.estimated_mm = estimate.deviation_mm;
    trial.possible = choice.time_met && choice.accuracy_met;
    const bool doubted =
        (request.accuracy_mm && doubt_of_accuracy(estimate, *request.accuracy_mm)) || !trial.kept_time();
    trial.announced = !trial.possible || result.cut_short || doubted;
    return trial;
}

std::vector<DialRequest> requests_of(const DialTrialOptions& options) {
    std::vector<DialRequest> requests;
    for (const double seconds : options.budgets_s) requests.push_back({{}, seconds});
    for (const double mm : options.accuracies_mm) requests.push_back({mm, {}});
    if (requests.empty() || options.last_seed < options.first_seed)
        throw InvalidInput("nothing to try: give phantoms, and budgets or accuracies");
    return requests;
}

std::vector<DialTrial> tried(const Phantom& phantom, const std::vector<DialRequest>& requests, const Fronts& fronts,
                             const UpdateOptions& update) {
    std::vector<DialTrial> trials;
    for (const DataKind kind : {DataKind::Labels, DataKind::Partial})
        for (const DialRequest& request : requests) trials.push_back(tried(phantom, kind, request, fronts, update));
    return trials;
}

}  // namespace

std::vector<DialTrial> try_dial(const std::filesystem::path& folder, const Fronts& fronts,
                                const DialTrialOptions& options, Observer& observer) {
    const std::vector<DialRequest> requests = requests_of(options);
    std::filesystem::create_directories(folder);
    std::vector<DialTrial> trials;
    for (std::uint64_t seed = options.first_seed; seed <= options.last_seed; ++seed) {
        observer.checkpoint("phantom " + std::to_string(seed),
                            double(seed - options.first_seed) / double(options.last_seed - options.first_seed + 1));
        const std::filesystem::path kept = folder / ("dial_" + std::to_string(seed) + ".csv");
        try {
            if (!std::filesystem::exists(kept))
                write_dial_trials(kept, tried(random_phantom(seed), requests, fronts, options.update));
            const std::vector<DialTrial> here = read_dial_trials(kept);
            trials.insert(trials.end(), here.begin(), here.end());
        } catch (const SolverFailure& failure) {
            observer.note("phantom " + std::to_string(seed) + " is left out: " + failure.what());
        }
    }
    observer.progress("trials", 1.0);
    return trials;
}

}  // namespace tissuewarp::study
