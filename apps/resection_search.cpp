#include "apps/resection_search.hpp"

#include "apps/model_making.hpp"
#include "apps/progress.hpp"
#include "apps/register_steps.hpp"
#include "imaging/labels.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace tissuewarp::apps {

namespace {

using registration::FoundResection;

/// Labels of the organ that the fixed map lacks, anchors apart.
std::vector<int> vanished(const RegistrationInputs& inputs, const RegisterOptions& options) {
    if (inputs.fixed_labels.empty()) return {};
    const std::vector<int> moving = imaging::labels_in(organ_of(inputs.moving_labels, options)),
                           fixed = imaging::labels_in(inputs.fixed_labels);
    std::vector<int> gone;
    std::set_difference(moving.begin(), moving.end(), fixed.begin(), fixed.end(), std::back_inserter(gone));
    std::erase_if(gone, [&](int label) {
        return std::find(options.anchors.begin(), options.anchors.end(), label) != options.anchors.end();
    });
    return gone;
}

FoundResection found_in_image(const RegistrationRun& run, double edge_length_mm, ProgressLine& progress) {
    registration::PreparedModel whole =
        made_model(run.options, run.inputs, registration::FirstLook().coarser * edge_length_mm, progress);
    add_images(whole, run.inputs, progress, registration::image_of_first_look());
    const registration::UpdateResult first = first_update(run, whole, progress);
    return find_resection(whole, first.deformation, run.inputs.moving_matched, run.inputs.fixed_matched, progress);
}

/// The voxels as a new label of the moving map.
int labelled(RegistrationInputs& inputs, const imaging::Volume& gone) {
    const int label = imaging::labels_in(inputs.moving_labels).back() + 1;
    inputs.moving_labels = inputs.moving_labels.as(CV_32S).clone();
    inputs.moving_labels.voxels.setTo(label, gone.voxels);
    inputs.label_names[label] = "resected";
    return label;
}

}  // namespace

void take_out_what_is_gone(RegistrationRun& run, RegisterOptions& options, double edge_length_mm,
                           ProgressLine& progress) {
    if (options.resected = vanished(run.inputs, options); !options.resected.empty()) {
        progress.note(fmt::format("taken for resected, since the fixed labels lack them: labels {}",
                                  fmt::join(options.resected, ", ")));
        return;
    }
    run.resection = options.match_image ? found_in_image(run, edge_length_mm, progress) : FoundResection{};
    if (run.resection->gone_ml == 0) return;
    options.resected = {labelled(run.inputs, run.resection->gone)};
    progress.note(fmt::format("taken for resected: {:.1f} ml at a cavity of {:.1f} ml of the fixed image",
                              run.resection->gone_ml, run.resection->cavity_ml));
}

}  // namespace tissuewarp::apps
