#include "registration/resection/find_resection.hpp"

#include "imaging/filters.hpp"
#include "imaging/labels.hpp"
#include "registration/doubts.hpp"
#include "registration/field.hpp"
#include "registration/resection/cavity_wall.hpp"
#include "registration/resection/without_structure.hpp"
#include "registration/warp.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

namespace tissuewarp::registration {

namespace {

using detail::CavityView;
using imaging::millilitres;
using Eigen::Vector3d;
using imaging::Volume;

/// What grey the fixed image mostly has where the moving one has a grey: median and deviation, by bins.
class ExpectedGrey {
public:
    ExpectedGrey(const Volume& moving, const Volume& fixed, const Volume& organ) {
        std::vector<float> sorted = detail::values_in(moving, organ);
        std::sort(sorted.begin(), sorted.end());
        for (std::size_t b = 1; b < bins && !sorted.empty(); ++b) limits_.push_back(sorted[b * sorted.size() / bins]);
        std::array<std::vector<float>, bins> of_bin;
        for (std::int64_t n = 0; n < fixed.geometry.voxel_count(); ++n)
            if (organ.data<std::uint8_t>()[n])
                of_bin[bin_of(moving.data<float>()[n])].push_back(fixed.data<float>()[n]);
        for (std::size_t b = 0; b < bins; ++b) {
            middle_[b] = detail::median(of_bin[b]);
            for (float& value : of_bin[b]) value = std::abs(value - float(middle_[b]));
            constexpr double of_normal = 1.4826;  // deviation over the median of distances from the middle
            deviation_[b] = of_normal * detail::median(of_bin[b]);
        }
    }
    /// In deviations.
    [[nodiscard]] double distance(float moving, float fixed) const {
        const std::size_t b = bin_of(moving);
        return deviation_[b] > 0 ? std::abs(fixed - middle_[b]) / deviation_[b] : 0;
    }

private:
    static constexpr std::size_t bins = 16;
    std::vector<float> limits_;
    std::array<double, bins> middle_{}, deviation_{};
    [[nodiscard]] std::size_t bin_of(float value) const {
        return static_cast<std::size_t>(std::upper_bound(limits_.begin(), limits_.end(), value) - limits_.begin());
    }
};

/// What of the images a cavity is told by, on one grid.
struct Look {
    CavityView fixed;
    Volume moving, moving_deviation;

    Look(const PreparedModel& whole, const Volume& moving_image, const Volume& fixed_image, const Volume& field)
        : Look(imaging::mask_of_all(warp_labels(whole.labels, field)), moving_image, fixed_image, field) {}

    /// Voxels without structure where the tissue that lies there shows some, or is of another grey.
    [[nodiscard]] Volume core() const {
        constexpr CavityOptions options = cavity_options;
        const Volume& organ = fixed.organ;
        const double most = options.most_deviation * fixed.tissue_deviation,
                     least = options.least_counterpart * detail::median(detail::values_in(moving_deviation, organ));
        const ExpectedGrey expected(moving, fixed.grey, organ);
        Volume core(organ.geometry, CV_8UC1);
        for (std::int64_t n = 0; n < organ.geometry.voxel_count(); ++n) {
            const bool flat = organ.data<std::uint8_t>()[n] && fixed.deviation.data<float>()[n] < most;
            core.data<std::uint8_t>()[n] =
                flat &&
                (moving_deviation.data<float>()[n] > least ||
                 expected.distance(moving.data<float>()[n], fixed.grey.data<float>()[n]) > options.least_difference);
        }
        return core;
    }

private:
    Look(const Volume& organ, const Volume& moving_image, const Volume& fixed_image, const Volume& field)
        : fixed(fixed_image, organ, organ),
          moving(detail::against_noise(warp_image(moving_image.as(CV_32F), field))),
          moving_deviation(detail::local_deviation(moving)) {}
};

/// Labelled voxels that a forward field leads into the cavity.
Volume led_into(const Volume& cavity, const Volume& labels, const Deformation& deformation) {
    const Volume field = displacement_moving_to_fixed(deformation, labels.geometry);
    const Volume numbers = cavity.as(CV_32S);
    const Volume map = labels.as(CV_32S);
    Volume gone(labels.geometry, CV_8UC1);
    const auto& size = labels.geometry.size;
    for (int k = 0; k < size[2]; ++k)
        for (int j = 0; j < size[1]; ++j)
            for (int i = 0; i < size[0]; ++i) {
                const std::int64_t n = labels.offset(i, j, k);
                if (map.data<std::int32_t>()[n] == 0) continue;
                const cv::Vec3f& u = field.data<cv::Vec3f>()[n];
                const Vector3d y = labels.geometry.point(Vector3d(i, j, k)) + Vector3d(u[0], u[1], u[2]);
                gone.data<std::uint8_t>()[n] = detail::label_at(numbers, y) != 0;
            }
    return gone;
}

}  // namespace

ImageModelOptions image_of_first_look() {
    ImageModelOptions options;
    options.features.count = FirstLook().features;
    return options;
}

UpdateOptions for_first_look(UpdateOptions options) {
    options.image.dense_coarsening = FirstLook().dense_coarsening;
    options.rematches = std::min(options.rematches, FirstLook().rounds);
    return options;
}

FoundResection find_resection(const PreparedModel& whole, const Deformation& deformation, const Volume& moving,
                              const Volume& fixed, Observer& observer) {
    constexpr double margin_mm = 10;
    const Volume field = displacement_fixed_to_moving(
        deformation, detail::grid_about(fixed.geometry, deformation.deformed_nodes(), margin_mm), {}, observer);
    const Look look(whole, moving, fixed, field);
    observer.checkpoint("resection", 0.5);
    FoundResection found;
    Volume cavity(look.fixed.organ.geometry, CV_8UC1);
    const std::vector<Volume> cores = detail::pieces_of(look.core(), cavity_options.least_core_ml);
    for (const Volume& core : cores) cavity.voxels |= detail::up_to_wall(look.fixed, core).voxels;
    if (!cores.empty() && look.fixed.tissue_deviation > 0)
        found.deviation =
            detail::median(detail::values_in(look.fixed.deviation, cores.front())) / look.fixed.tissue_deviation;
    found.gone = led_into(cavity, whole.labels, deformation);
    if (millilitres(found.gone) < cavity_options.least_ml) {
        found.gone.voxels.setTo(0);
        cavity.voxels.setTo(0);
    }
    found.gone_ml = millilitres(found.gone);
    found.cavity_ml = millilitres(cavity);
    found.cavity = imaging::resample(cavity, fixed.geometry, imaging::Interpolation::Nearest);
    return found;
}

std::vector<Doubt> doubts_of(const FoundResection& found, const Volume& gap) {
    constexpr double least_agreement = 0.7;
    std::vector<Doubt> doubts;
    if (found.gone_ml == 0) {
        doubts.push_back({"resected.not_found", 0, cavity_options.least_ml,
                          "no cavity was found in the fixed image that tissue without a counterpart lies at: all of it "
                          "is taken to be there",
                          "draw what is gone in the moving labels, and name its label by --resected"});
        return doubts;
    }
    const Volume hole = imaging::mask_of_all(gap);
    Volume both = hole;
    both.voxels = hole.voxels & found.cavity.voxels;
    const double agreement = 2 * millilitres(both) / (millilitres(hole) + millilitres(found.cavity));
    if (agreement < least_agreement)
        doubts.push_back({"resected.unclear", agreement, least_agreement,
                          "the hole that the model leaves and the cavity that was found in the image overlap by a Dice "
                          "of " +
                              detail::to_text(agreement) + " only",
                          "draw what is gone in the moving labels, and name its label by --resected"});
    return doubts;
}

}  // namespace tissuewarp::registration
