#include "apps/match_masks.hpp"

#include "apps/noted_images.hpp"
#include "imaging/filters.hpp"
#include "registration/matching/image_mask.hpp"

#include <fmt/format.h>

namespace tissuewarp::apps {

namespace {

std::string excluded_text(const imaging::Volume& image, const imaging::Volume& mask) {
    const imaging::Volume here = imaging::resample(mask, image.geometry, imaging::Interpolation::Nearest);
    const double share = 1 - cv::countNonZero(here.voxels.reshape(1, 1)) / double(image.geometry.voxel_count());
    if (share == 0) return "excludes nothing: voxels that may not be matched must be 0";
    return fmt::format("excludes {:.3g} % of the image from matching, where it is 0", 100 * share);
}

/// The image, and its contrasts, which change.
imaging::Volume matched(const imaging::Volume& image, std::vector<imaging::Volume>& contrasts,
                        const std::filesystem::path& path, std::vector<std::string>& notes) {
    if (path.empty()) return image;
    imaging::ReadResult mask = imaging::read_volume_with_notes(path);
    for (const std::string& note : notes_of(mask, path)) notes.push_back(note);
    if (mask.volume.channels() > 1) throw InvalidInput(fmt::format("'{}' is no mask: it holds vectors", path.string()));
    try {
        imaging::Volume result = registration::without_unmatched(image, mask.volume);
        for (imaging::Volume& contrast : contrasts) contrast = registration::without_unmatched(contrast, mask.volume);
        notes.push_back(fmt::format("'{}' {}", path.string(), excluded_text(image, mask.volume)));
        return result;
    } catch (const InvalidInput& problem) {
        throw InvalidInput(fmt::format("'{}': {}", path.string(), problem.what()));
    }
}

}  // namespace

void exclude_unmatched_moving(RegistrationInputs& inputs, const PreoperativeOptions& options) {
    inputs.moving_matched = matched(inputs.moving, inputs.moving_contrasts, options.moving_mask, inputs.notes);
}

void exclude_unmatched_fixed(RegistrationInputs& inputs, const IntraoperativeOptions& options) {
    inputs.fixed_matched = matched(inputs.fixed, inputs.fixed_contrasts, options.fixed_mask, inputs.notes);
}

}  // namespace tissuewarp::apps
