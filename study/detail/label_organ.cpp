#include "study/detail/label_organ.hpp"

#include "core/errors.hpp"
#include "imaging/filters.hpp"
#include "imaging/labels.hpp"
#include "imaging/sampling.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace tissuewarp::study::detail {

using Eigen::Vector3d;

namespace {

/// The grid of a box of voxels with a margin around it.
imaging::Geometry around(const imaging::Geometry& grid, const imaging::LabelStatistics& box) {
    constexpr double margin_mm = 10;
    imaging::Geometry result = grid;
    Vector3d first;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const int margin = static_cast<int>(std::ceil(margin_mm / grid.spacing[Eigen::Index(axis)]));
        first[Eigen::Index(axis)] = box.lower[axis] - margin;
        result.size[axis] = box.upper[axis] - box.lower[axis] + 2 * margin;
    }
    result.origin = grid.point(first);
    return result;
}

imaging::Volume piece_of(const imaging::Volume& labels, int label) {
    const imaging::Volume piece = imaging::largest_component(imaging::mask_of(labels, label));
    const auto box = imaging::label_statistics(piece.as(CV_32S)).at(1);
    return imaging::resample(piece, around(labels.geometry, box), imaging::Interpolation::Nearest);
}

}  // namespace

LabelOrgan::LabelOrgan(const imaging::Volume& labels, int label) : kind_("label " + std::to_string(label)) {
    const imaging::Volume piece = piece_of(labels, label);
    distance_ = imaging::smooth(imaging::signed_distance(piece), piece.geometry.spacing.maxCoeff());
    voxels_ = imaging::Volume(piece.geometry, CV_32SC1);
    for (std::int64_t n = 0; n < piece.geometry.voxel_count(); ++n)
        voxels_.data<std::int32_t>()[n] = distance_.data<float>()[n] < 0;
    const auto statistics = imaging::label_statistics(voxels_).at(1);
    centre_ = statistics.centroid;
    for (std::size_t axis = 0; axis < 3; ++axis)
        length_ = std::max(
            length_, (statistics.upper[axis] - statistics.lower[axis]) * piece.geometry.spacing[Eigen::Index(axis)]);
    for (const int i : {statistics.lower[0], statistics.upper[0]})
        for (const int j : {statistics.lower[1], statistics.upper[1]})
            for (const int k : {statistics.lower[2], statistics.upper[2]})
                reach_ = std::max(reach_,
                                  (piece.geometry.point(Vector3d(i, j, k) - Vector3d::Constant(0.5)) - centre_).norm());
}

double LabelOrgan::outer_distance(const Vector3d& point) const {
    const imaging::LinearSampler sampler(distance_);
    return sampler.contains(point) ? sampler.value(point) : reach_;
}

LabelOrgan random_label_organ(const imaging::Volume& labels, double least_ml, Random& random) {
    std::vector<int> usable;
    for (const auto& [label, statistics] : imaging::label_statistics(labels)) {
        const auto largest =
            imaging::label_statistics(imaging::largest_component(imaging::mask_of(labels, label)).as(CV_32S)).at(1);
        if (largest.volume_mm3 >= 1000 * least_ml) usable.push_back(label);
    }
    if (usable.empty())
        throw InvalidInput("the label map has no organ of " + std::to_string(int(least_ml)) + " ml or more");
    return {labels, usable[std::size_t(random.index(int(usable.size())))]};
}

}  // namespace tissuewarp::study::detail
