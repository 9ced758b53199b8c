#include "registration/boundary/label_boundary_field.hpp"

#include "imaging/filters.hpp"
#include "imaging/labels.hpp"
#include "imaging/sampling.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <tuple>

namespace tissuewarp::registration {

using imaging::Volume;

namespace {

constexpr BoundaryFieldOptions options;

/// A smoothed indicator on the bounding box of its label: zero outside, which clamped sampling gives for nothing
/// because the box has a margin wider than the Gaussian.
struct Indicator {
    Volume volume;
    imaging::LinearSampler sampler;
    explicit Indicator(Volume smoothed) : volume(std::move(smoothed)), sampler(volume) {}
};

/// `smoothing` in voxels.
std::unique_ptr<Indicator> indicator(const Volume& mask, const imaging::LabelStatistics& box, double smoothing) {
    const int margin = static_cast<int>(std::ceil(4 * smoothing)) + 2;
    std::array<int, 3> lower{}, upper{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        lower[axis] = std::max(0, box.lower[axis] - margin);
        upper[axis] = std::min(mask.geometry.size[axis], box.upper[axis] + margin);
    }
    const Volume part = imaging::crop(mask, lower, upper);
    return std::make_unique<Indicator>(imaging::smooth(part, smoothing * part.geometry.spacing.minCoeff()));
}

}  // namespace

struct LabelBoundaryField::Impl {
    std::map<int, std::unique_ptr<Indicator>> of_label;
    std::unique_ptr<Indicator> of_all;
    double step = 0.5;  // mm

    [[nodiscard]] bool knows(int label) const { return label == 0 || of_label.contains(label); }

    [[nodiscard]] double presence(int label, const Eigen::Vector3d& point) const {
        if (label == 0) return 1 - double(of_all->sampler.value(point));
        return double(of_label.at(label)->sampler.value(point));
    }

    /// Positive in `inner`, negative in `outer`.
    [[nodiscard]] double side(const Eigen::Vector3d& point, int inner, int outer) const {
        return presence(inner, point) - presence(outer, point);
    }

    /// Both labels meet here and hardly anything else does, and the boundary faces along `normal`.
    [[nodiscard]] bool is_boundary(const Eigen::Vector3d& point, const Eigen::Vector3d& normal, int inner, int outer,
                                   double least_cosine) const {
        if (presence(inner, point) + presence(outer, point) < options.least_presence) return false;
        Eigen::Vector3d gradient;
        for (int axis = 0; axis < 3; ++axis) {
            const Eigen::Vector3d offset = step * Eigen::Vector3d::Unit(axis);
            gradient[axis] = side(point + offset, inner, outer) - side(point - offset, inner, outer);
        }
        return -gradient.dot(normal) >= least_cosine * gradient.norm() && gradient.norm() > 0;
    }
};

LabelBoundaryField::LabelBoundaryField(const Volume& label_map, const std::map<int, double>& thickness_mm)
    : impl_(std::make_unique<Impl>()) {
    const Volume map = label_map.as(CV_32S);
    const double voxel_mm = map.geometry.spacing.minCoeff();
    const auto statistics = imaging::label_statistics(map);
    imaging::LabelStatistics everything;
    everything.lower = map.geometry.size;
    for (const auto& [label, box] : statistics) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
            everything.lower[axis] = std::min(everything.lower[axis], box.lower[axis]);
            everything.upper[axis] = std::max(everything.upper[axis], box.upper[axis]);
        }
        const auto thickness = thickness_mm.find(label);
        if (thickness == thickness_mm.end()) continue;
        const double bearable = options.smoothing_share * thickness->second / voxel_mm;
        const double smoothing = std::clamp(bearable, options.least_smoothing, options.most_smoothing);
        impl_->of_label[label] = indicator(imaging::mask_of(map, label), box, smoothing);
    }
    if (statistics.empty()) throw InvalidInput("the label map is empty: there is no boundary to match");
    impl_->of_all = indicator(imaging::mask_of_all(map), everything, options.most_smoothing);
    impl_->step = options.step_voxels * voxel_mm;
}

LabelBoundaryField::~LabelBoundaryField() = default;
LabelBoundaryField::LabelBoundaryField(LabelBoundaryField&&) noexcept = default;
LabelBoundaryField& LabelBoundaryField::operator=(LabelBoundaryField&&) noexcept = default;

double LabelBoundaryField::crossing(const Eigen::Vector3d& point, const Eigen::Vector3d& normal, int inner, int outer,
                                    double range_mm, double max_angle_deg) const {
    constexpr double none = std::numeric_limits<double>::quiet_NaN();
    if (!impl_->knows(inner) || !impl_->knows(outer)) return none;
    const double step = impl_->step, least_cosine = std::cos(max_angle_deg * EIGEN_PI / 180);
    const int steps = static_cast<int>(std::ceil(range_mm / step));
    const auto side = [&](double s) { return impl_->side(point + s * normal, inner, outer); };

    // Walk both ways at once, so that the first crossing found is the nearest.
    double ahead = side(0), behind = ahead;
    for (int i = 1; i <= steps; ++i) {
        const double next_ahead = side(i * step), next_behind = side(-i * step);
        std::optional<double> nearest;
        if (ahead > 0 && next_ahead <= 0) nearest = step * (i - 1 + ahead / (ahead - next_ahead));
        if (behind <= 0 && next_behind > 0) {
            const double back = -step * (i - 1 + behind / (behind - next_behind));
            if (!nearest || -back < *nearest) nearest = back;
        }
        if (nearest && impl_->is_boundary(point + *nearest * normal, normal, inner, outer, least_cosine))
            return *nearest;
        ahead = next_ahead;
        behind = next_behind;
    }
    return none;
}

}  // namespace tissuewarp::registration
