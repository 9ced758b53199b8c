#include "registration/boundary/label_boundary_field.hpp"

#include "imaging/filters.hpp"
#include "imaging/sampling.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

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

/// What is smoothed of a map: a label, or where it is 0 all of them.
struct Part {
    int label = 0;
    imaging::LabelExtent box;
    double smoothing = 0;  // voxels
};

std::unique_ptr<Indicator> indicator(const Volume& map, const Part& part) {
    const int margin = static_cast<int>(std::ceil(4 * part.smoothing)) + 2;
    const Volume mask = mask_in(map, grown(part.box, {margin, margin, margin}, map.geometry), part.label);
    return std::make_unique<Indicator>(imaging::smooth(mask, part.smoothing * mask.geometry.spacing.minCoeff()));
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

LabelBoundaryField::LabelBoundaryField(const Volume& map, const std::map<int, double>& thickness_mm)
    : LabelBoundaryField(map, imaging::label_extents(map), thickness_mm) {}

LabelBoundaryField::LabelBoundaryField(const Volume& map, const imaging::LabelExtents& extents,
                                       const std::map<int, double>& thickness_mm)
    : impl_(std::make_unique<Impl>()) {
    const double voxel_mm = map.geometry.spacing.minCoeff();
    if (extents.empty()) throw InvalidInput("the label map is empty: there is no boundary to match");
    std::vector<Part> parts(1);
    parts[0] = {0, imaging::extent_of_all(extents), options.most_smoothing};
    for (const auto& [label, box] : extents) {
        const auto thickness = thickness_mm.find(label);
        if (thickness == thickness_mm.end()) continue;
        const double bearable = options.smoothing_share * thickness->second / voxel_mm;
        parts.push_back({label, box, std::clamp(bearable, options.least_smoothing, options.most_smoothing)});
    }
    std::vector<std::unique_ptr<Indicator>> indicators(parts.size());
    tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t n) { indicators[n] = indicator(map, parts[n]); });
    impl_->of_all = std::move(indicators[0]);
    for (std::size_t n = 1; n < parts.size(); ++n) impl_->of_label[parts[n].label] = std::move(indicators[n]);
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
