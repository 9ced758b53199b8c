#include "apps/dial.hpp"

#include "core/errors.hpp"
#include "imaging/labels.hpp"
#include "registration/dial/fronts_io.hpp"

#include <fmt/format.h>

namespace tissuewarp::apps {

namespace {

using namespace registration;

void require_compatible(const RegisterOptions& options) {
    if (options.edge_length > 0)
        throw InvalidInput("--edge-length beside --accuracy or --time-budget, which choose it; leave one of them out");
    if (options.accuracy && options.no_error_estimate)
        throw InvalidInput("--accuracy is checked against the error estimate; leave out --no-error-estimate");
}

double megavoxels(const imaging::Geometry& grid) {
    return double(grid.voxel_count()) / 1e6;
}

}  // namespace

DialChoice dial_choice(const RegistrationInputs& inputs, const RegisterOptions& options) {
    require_compatible(options);
    if (options.match_image)
        throw InvalidInput(
            "no figures for matching the image itself; give --edge-length in place of --accuracy and --time-budget");
    const imaging::Geometry& output = inputs.fixed_grid() ? *inputs.fixed_grid() : inputs.moving_grid();
    DialCase what;
    what.kind = inputs.fixed_labels.empty() ? DataKind::Partial : DataKind::Labels;
    what.organ_mm = organ_size(organ_of(inputs.moving_labels, options));
    what.moving_megavoxels = megavoxels(inputs.moving_grid());
    what.output_megavoxels = megavoxels(output);
    if (!inputs.fixed_labels.empty()) what.fixed_label_megavoxels = megavoxels(inputs.fixed_labels.geometry);
    return choose(known_fronts(), {options.accuracy, options.time_budget}, what);
}

void doubt_dial(RegistrationRun& run) {
    constexpr double late = 1.1;
    std::vector<registration::Doubt>& doubts = run.result.doubts;
    if (const auto& budget = run.options.time_budget; budget && run.intraoperative_seconds > late * *budget)
        doubts.push_back(
            {"time.exceeded", run.intraoperative_seconds, *budget,
             fmt::format("the time budget of {:.3g} s was exceeded: {:.3g} s", *budget, run.intraoperative_seconds),
             "allow more time, or a coarser mesh", Severity::Notice});
    if (!run.options.accuracy) return;
    if (auto doubt = doubt_of_accuracy(summarise(*run.products.uncertainty), *run.options.accuracy))
        doubts.push_back(std::move(*doubt));
}

}  // namespace tissuewarp::apps
