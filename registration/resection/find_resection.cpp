#include "registration/resection/find_resection.hpp"

#include "imaging/filters.hpp"
#include "imaging/foreground.hpp"
#include "imaging/labels.hpp"
#include "registration/doubts.hpp"
#include "registration/field.hpp"
#include "registration/field/mesh_labels.hpp"
#include "registration/resection/cavity_wall.hpp"
#include "registration/warp.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

namespace tissuewarp::registration {

namespace {

using Eigen::Vector3d;
using imaging::Volume;

constexpr double mm3_per_ml = 1000;

double millilitres(const Volume& mask) {
    return cv::countNonZero(mask.voxels.reshape(1, 1)) * mask.geometry.voxel_volume() / mm3_per_ml;
}

/// The grid of an image, not finer than the options have it, about the nodes of a mesh.
imaging::Geometry working_grid(const imaging::Geometry& image, const Eigen::Matrix3Xd& nodes) {
    constexpr double margin_mm = 10;
    imaging::Geometry grid = image;
    grid.spacing = image.spacing.cwiseMax(cavity_options.grid_mm);
    const Eigen::Matrix3Xd along = image.direction.transpose() * nodes;
    const Vector3d lower = along.rowwise().minCoeff().array() - margin_mm,
                   upper = along.rowwise().maxCoeff().array() + margin_mm;
    grid.origin = image.direction * lower;
    for (Eigen::Index axis = 0; axis < 3; ++axis)
        grid.size[static_cast<std::size_t>(axis)] =
            1 + static_cast<int>(std::ceil((upper[axis] - lower[axis]) / grid.spacing[axis]));
    return grid;
}

/// Means over boxes about each voxel; borders replicate.
Volume box_mean(const Volume& image, const Vector3d& half_mm) {
    Volume result = image.clone();
    const auto& size = image.geometry.size;
    const std::array<std::int64_t, 3> stride{1, size[0], std::int64_t{size[0]} * size[1]};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
        const double spacing = image.geometry.spacing[static_cast<Eigen::Index>(axis)];
        const int half = std::max(1, static_cast<int>(std::lround(half_mm[static_cast<Eigen::Index>(axis)] / spacing)));
        const int last = size[axis] - 1;
        tbb::parallel_for(0, size[v], [&](int b) {
            std::vector<double> line(static_cast<std::size_t>(size[axis]));
            for (int a = 0; a < size[u]; ++a) {
                float* first = result.data<float>() + stride[u] * a + stride[v] * b;
                for (int n = 0; n <= last; ++n) line[static_cast<std::size_t>(n)] = first[stride[axis] * n];
                const auto at = [&](int n) { return line[static_cast<std::size_t>(std::clamp(n, 0, last))]; };
                double sum = 0;
                for (int n = -half; n <= half; ++n) sum += at(n);
                for (int n = 0; n <= last; ++n) {
                    first[stride[axis] * n] = static_cast<float>(sum / (2 * half + 1));
                    sum += at(n + half + 1) - at(n - half);
                }
            }
        });
    }
    return result;
}

/// Standard deviation of an image (float32) in a box about each voxel. Boxes, unlike Gaussians, see nothing of a wall
/// beyond them, however bright.
Volume local_deviation(const Volume& image) {
    const Vector3d half = Vector3d::Constant(cavity_options.window_mm);
    Volume centred = image.clone();  // of large means little would be left of squares in float32
    centred.voxels -= cv::mean(image.voxels.reshape(1, 1));
    Volume squares = centred.clone();
    cv::multiply(centred.voxels, centred.voxels, squares.voxels);
    const Volume mean = box_mean(centred, half);
    Volume result = box_mean(squares, half);
    auto* value = result.data<float>();
    for (std::int64_t n = 0; n < result.geometry.voxel_count(); ++n)
        value[n] = std::sqrt(std::max(0.0F, value[n] - mean.data<float>()[n] * mean.data<float>()[n]));
    return result;
}

std::vector<float> values_in(const Volume& image, const Volume& mask) {
    std::vector<float> values;
    for (std::int64_t n = 0; n < image.geometry.voxel_count(); ++n)
        if (mask.data<std::uint8_t>()[n]) values.push_back(image.data<float>()[n]);
    return values;
}

double median(std::vector<float> values) {
    if (values.empty()) return 0;
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

/// What grey the fixed image mostly has where the moving one has a grey: median and deviation, by bins.
class ExpectedGrey {
public:
    ExpectedGrey(const Volume& moving, const Volume& fixed, const Volume& organ) {
        std::vector<float> sorted = values_in(moving, organ);
        std::sort(sorted.begin(), sorted.end());
        for (std::size_t b = 1; b < bins && !sorted.empty(); ++b) limits_.push_back(sorted[b * sorted.size() / bins]);
        std::array<std::vector<float>, bins> of_bin;
        for (std::int64_t n = 0; n < fixed.geometry.voxel_count(); ++n)
            if (organ.data<std::uint8_t>()[n])
                of_bin[bin_of(moving.data<float>()[n])].push_back(fixed.data<float>()[n]);
        for (std::size_t b = 0; b < bins; ++b) {
            middle_[b] = median(of_bin[b]);
            for (float& value : of_bin[b]) value = std::abs(value - float(middle_[b]));
            constexpr double of_normal = 1.4826;  // deviation over the median of distances from the middle
            deviation_[b] = of_normal * median(of_bin[b]);
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
    Volume organ;          // uint8
    Volume fixed, moving;  // float32, against noise
    Volume fixed_deviation, moving_deviation;
    double tissue_deviation = 0;  // median over the organ, fixed

    Look(const PreparedModel& whole, const Deformation& deformation, const Volume& moving_image,
         const Volume& fixed_image, Observer& observer) {
        constexpr double against_noise_mm = 0.7;
        const meshing::TetMesh deformed = deformation.deformed_mesh();
        const imaging::Geometry grid = working_grid(fixed_image.geometry, deformed.nodes);
        const Volume field = displacement_fixed_to_moving(deformation, grid, {}, observer);
        organ = imaging::mask_of_all(warp_labels(whole.labels, field));
        fixed = imaging::smooth(imaging::resample(fixed_image.as(CV_32F), grid, imaging::Interpolation::Linear),
                                against_noise_mm);
        moving = imaging::smooth(warp_image(moving_image.as(CV_32F), field), against_noise_mm);
        fixed_deviation = local_deviation(fixed);
        moving_deviation = local_deviation(moving);
        tissue_deviation = median(values_in(fixed_deviation, organ));
    }

    /// Voxels without structure where the tissue that lies there shows some, or is of another grey.
    [[nodiscard]] Volume core() const {
        constexpr CavityOptions options = cavity_options;
        const double most = options.most_deviation * tissue_deviation,
                     least = options.least_counterpart * median(values_in(moving_deviation, organ));
        const ExpectedGrey expected(moving, fixed, organ);
        Volume core(organ.geometry, CV_8UC1);
        for (std::int64_t n = 0; n < organ.geometry.voxel_count(); ++n) {
            const bool flat = organ.data<std::uint8_t>()[n] && fixed_deviation.data<float>()[n] < most;
            core.data<std::uint8_t>()[n] =
                flat && (moving_deviation.data<float>()[n] > least ||
                         expected.distance(moving.data<float>()[n], fixed.data<float>()[n]) > options.least_difference);
        }
        return core;
    }
};

/// Pieces of a mask, largest first, of more than a volume.
std::vector<Volume> pieces_of(const Volume& mask, double least_ml) {
    const Volume numbered = imaging::connected_components(mask);
    std::vector<Volume> pieces;
    for (const int piece : imaging::labels_in(numbered)) {
        Volume one = imaging::mask_of(numbered, piece);
        if (millilitres(one) < least_ml) break;
        pieces.push_back(std::move(one));
    }
    return pieces;
}

/// A piece of a core up to its wall: halfway between its grey and that of the organ about it.
Volume up_to_wall(const Look& look, const Volume& piece) {
    constexpr CavityOptions options = cavity_options;
    constexpr double within_deviations = 4, of_normal = 1.4826;
    const std::vector<float> inside = values_in(look.fixed, piece);
    const double grey = median(inside);
    std::vector<float> off = inside;
    for (float& value : off) value = std::abs(value - float(grey));
    const Volume near = imaging::dilate(piece, options.reach_mm);
    Volume around = imaging::dilate(near, options.reach_mm);
    around.voxels &= ~near.voxels & look.organ.voxels;
    const double halfway = 0.5 * std::abs(median(values_in(look.fixed, around)) - grey),
                 most = std::max({within_deviations * of_normal * median(off), look.tissue_deviation, halfway});
    Volume like(piece.geometry, CV_8UC1);
    for (std::int64_t n = 0; n < piece.geometry.voxel_count(); ++n)
        like.data<std::uint8_t>()[n] =
            piece.data<std::uint8_t>()[n] ||
            (near.data<std::uint8_t>()[n] && std::abs(look.fixed.data<float>()[n] - grey) < most);
    return imaging::without_holes(imaging::largest_component(imaging::open(like, options.opening_mm)));
}

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

FoundResection find_resection(const PreparedModel& whole, const Deformation& deformation, const Volume& moving,
                              const Volume& fixed, Observer& observer) {
    const Look look(whole, deformation, moving, fixed, observer);
    observer.checkpoint("resection", 0.5);
    FoundResection found;
    Volume cavity(look.organ.geometry, CV_8UC1);
    const std::vector<Volume> cores = pieces_of(look.core(), cavity_options.least_core_ml);
    for (const Volume& core : cores) cavity.voxels |= up_to_wall(look, core).voxels;
    if (!cores.empty() && look.tissue_deviation > 0)
        found.deviation = median(values_in(look.fixed_deviation, cores.front())) / look.tissue_deviation;
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
