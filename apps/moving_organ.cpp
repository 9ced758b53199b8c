#include "apps/moving_organ.hpp"

#include <fmt/format.h>

namespace tissuewarp::apps {

namespace {

void take_foreground(RegistrationInputs& inputs, const RegisterOptions& options) {
    try {
        inputs.foreground = imaging::foreground(inputs.moving);
    } catch (const InvalidInput& problem) {
        throw InvalidInput(
            fmt::format("'{}': {}; draw it, and give --moving-labels", options.moving.string(), problem.what()));
    }
    inputs.moving_labels = inputs.foreground->labels;
    inputs.notes.push_back(fmt::format(
        "no labels say where the organ is: what is brighter than {:.4g} in '{}' was taken, its largest piece without "
        "holes, {:.4g} ml; see its outline in preview.png, and give --moving-labels where that is not the organ",
        inputs.foreground->threshold, options.moving.string(), inputs.foreground->volume_mm3 / 1000));
}

}  // namespace

const std::filesystem::path& organ_file(const RegisterOptions& options) {
    return options.moving_labels.empty() ? options.moving : options.moving_labels;
}

void find_organ(RegistrationInputs& inputs, const RegisterOptions& options) {
    take_foreground(inputs, options);
}

}  // namespace tissuewarp::apps
