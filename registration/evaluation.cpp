#include "registration/evaluation.hpp"

#include "core/errors.hpp"
#include "registration/detail/point_tree.hpp"
#include "registration/field.hpp"

#include <Eigen/Dense>

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>

namespace tissuewarp::registration {

namespace {

using imaging::Geometry;
using imaging::Volume;

/// Percentile of a vector that is reordered: linear between order statistics, numpy's default.
template <class T>
double percentile(std::vector<T>& values, double percent) {
    const double position = percent / 100.0 * static_cast<double>(values.size() - 1);
    const auto lower = values.begin() + static_cast<std::ptrdiff_t>(position);
    std::nth_element(values.begin(), lower, values.end());
    const double fraction = position - std::floor(position), low = *lower;
    if (fraction == 0.0) return low;
    return low + fraction * (static_cast<double>(*std::min_element(lower + 1, values.end())) - low);
}

/// Faces between voxels of a label and others, as their centres (mm along the axes), and the number of voxels.
struct Region {
    std::vector<Eigen::Vector3d> faces;
    long long voxels = 0;
};

/// Every label's region, and under key 0 that of all labels together.
std::map<int, Region> regions_of(const Volume& labels) {
    std::map<int, Region> regions;
    const Geometry& grid = labels.geometry;
    const auto* value = labels.data<std::int32_t>();
    const std::array<std::int64_t, 3> stride{1, grid.size[0], std::int64_t{grid.size[0]} * grid.size[1]};
    for (int k = 0; k < grid.size[2]; ++k) {
        for (int j = 0; j < grid.size[1]; ++j) {
            for (int i = 0; i < grid.size[0]; ++i) {
                const std::array<int, 3> index{i, j, k};
                const std::int64_t voxel = labels.offset(i, j, k);
                const int here = value[voxel];
                if (here != 0) {
                    ++regions[here].voxels;
                    ++regions[0].voxels;
                }
                for (int axis = 0; axis < 3; ++axis) {
                    if (index[axis] + 1 >= grid.size[axis]) continue;
                    const int there = value[voxel + stride[axis]];
                    if (there == here) continue;
                    Eigen::Vector3d centre(i, j, k);
                    centre[axis] += 0.5;
                    centre = centre.cwiseProduct(grid.spacing);
                    if (here != 0) regions[here].faces.push_back(centre);
                    if (there != 0) regions[there].faces.push_back(centre);
                    if (here == 0 || there == 0) regions[0].faces.push_back(centre);
                }
            }
        }
    }
    return regions;
}

std::vector<double> distances(const std::vector<Eigen::Vector3d>& from, const detail::PointTree& to) {
    std::vector<double> result(from.size());
    tbb::parallel_for(std::size_t{0}, from.size(), [&](std::size_t n) { result[n] = to.distance(from[n]); });
    return result;
}

void measure_surfaces(const Region& a, const Region& b, Overlap& overlap) {
    if (a.faces.empty() && b.faces.empty() && overlap.dice == 1.0) return;  // both fill the image
    if (a.faces.empty() || b.faces.empty()) {
        overlap.mean_surface_distance_mm = overlap.hausdorff_95_mm = std::numeric_limits<double>::infinity();
        return;
    }
    std::vector<double> to_b = distances(a.faces, detail::PointTree(b.faces));
    std::vector<double> to_a = distances(b.faces, detail::PointTree(a.faces));
    const auto mean = [](const std::vector<double>& d) {
        return std::accumulate(d.begin(), d.end(), 0.0) / static_cast<double>(d.size());
    };
    overlap.mean_surface_distance_mm = 0.5 * (mean(to_a) + mean(to_b));
    overlap.hausdorff_95_mm = std::max(percentile(to_a, 95.0), percentile(to_b, 95.0));
}

/// Percentiles of weighted values in ascending order: value n sits at the cumulated mean weight of its neighbours up to
/// there, linear in between. With equal weights this is the percentile above.
class WeightedPercentiles {
public:
    WeightedPercentiles(const std::vector<double>& ascending, const std::vector<double>& weights)
        : values_(ascending), position_(ascending.size(), 0.0) {
        for (std::size_t n = 1; n < values_.size(); ++n)
            position_[n] = position_[n - 1] + 0.5 * (weights[n - 1] + weights[n]);
    }
    [[nodiscard]] double operator()(double percent) const {
        const double wanted = percent / 100.0 * position_.back();
        const auto above = std::upper_bound(position_.begin(), position_.end(), wanted);
        if (above == position_.begin() || above == position_.end()) return values_.back();
        const auto n = static_cast<std::size_t>(above - position_.begin());
        const double fraction = (wanted - position_[n - 1]) / (position_[n] - position_[n - 1]);
        return values_[n - 1] + fraction * (values_[n] - values_[n - 1]);
    }

private:
    const std::vector<double>& values_;
    std::vector<double> position_;
};

constexpr std::size_t most_places = 20;

}  // namespace

Summary summarise(std::vector<double> values) {
    Summary summary;
    if (values.empty()) return summary;
    if (!std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); }))
        throw InvalidInput("summary: a value is not finite; remove it first");
    summary.count = static_cast<int>(values.size());
    summary.mean = std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
    summary.median = percentile(values, 50.0);
    summary.percentile_95 = percentile(values, 95.0);
    summary.maximum = *std::max_element(values.begin(), values.end());
    return summary;
}

TargetError target_error(const Landmarks& landmarks, const Eigen::Matrix3Xd& mapped, double moved_mm) {
    if (landmarks.moving.cols() != landmarks.fixed.cols() || landmarks.moving.cols() != mapped.cols())
        throw InvalidInput("target error: " + std::to_string(landmarks.moving.cols()) + " moving, " +
                           std::to_string(landmarks.fixed.cols()) + " fixed and " + std::to_string(mapped.cols()) +
                           " mapped points; their numbers must agree");
    std::vector<double> before, after, moved_before, moved_after;
    for (Eigen::Index p = 0; p < mapped.cols(); ++p) {
        before.push_back((landmarks.moving.col(p) - landmarks.fixed.col(p)).norm());
        after.push_back((mapped.col(p) - landmarks.fixed.col(p)).norm());
        if (before.back() <= moved_mm) continue;
        moved_before.push_back(before.back());
        moved_after.push_back(after.back());
    }
    return {summarise(before), summarise(after), summarise(moved_before), summarise(moved_after), moved_mm};
}

std::map<int, Overlap> overlap(const Volume& labels, const Volume& reference) {
    for (const Volume* map : {&labels, &reference})
        if (map->empty() || map->channels() != 1 || map->voxels.depth() >= CV_32F)
            throw InvalidInput("overlap: needs two label maps of integers, one channel each; use read_labels");
    if (!imaging::same_grid(labels.geometry, reference.geometry))
        throw InvalidInput("overlap: the grids differ by " +
                           std::to_string(imaging::grid_distance(labels.geometry, reference.geometry)) +
                           " voxels, limit 0.001; resample one map onto the grid of the other");
    const Volume a = labels.as(CV_32S), b = reference.as(CV_32S);
    std::map<int, long long> common;
    for (std::int64_t n = 0; n < a.geometry.voxel_count(); ++n) {
        const int in_a = a.data<std::int32_t>()[n], in_b = b.data<std::int32_t>()[n];
        if (in_a != 0 && in_b != 0) ++common[0];
        if (in_a != 0 && in_a == in_b) ++common[in_a];
    }
    std::map<int, Region> regions_a = regions_of(a), regions_b = regions_of(b);
    for (const auto& [label, region] : regions_a) regions_b[label];
    std::map<int, Overlap> result;
    for (const auto& [label, region_b] : regions_b) {
        const Region& region_a = regions_a[label];
        Overlap& entry = result[label];
        entry.dice = 2.0 * static_cast<double>(common[label]) / static_cast<double>(region_a.voxels + region_b.voxels);
        measure_surfaces(region_a, region_b, entry);
    }
    return result;
}

JacobianReport mesh_jacobians(const Deformation& deformation) {
    const auto& mesh = deformation.mesh;
    meshing::require_valid(mesh, "deformation");
    if (deformation.displacement.cols() != mesh.nodes.cols() || !deformation.displacement.allFinite())
        throw InvalidInput("mesh Jacobians: needs one finite displacement for each of the " +
                           std::to_string(mesh.node_count()) + " nodes");
    const Eigen::VectorXd rest = meshing::tet_volumes(mesh);
    const Eigen::VectorXd now = meshing::tet_volumes({mesh.nodes + deformation.displacement, mesh.tets, mesh.labels});
    std::vector<int> order(static_cast<std::size_t>(mesh.tet_count()));
    std::iota(order.begin(), order.end(), 0);
    const Eigen::VectorXd ratio = now.cwiseQuotient(rest);
    std::stable_sort(order.begin(), order.end(), [&](int x, int y) { return ratio[x] < ratio[y]; });

    JacobianReport report;
    std::vector<double> values, weights;
    for (const int tet : order) {
        values.push_back(ratio[tet]);
        weights.push_back(rest[tet]);
        if (ratio[tet] > 0.0) continue;
        ++report.folded;
        report.folded_mm3 += rest[tet];
        if (report.folded_places.size() < most_places)
            report.folded_places.emplace_back(mesh.nodes(Eigen::all, mesh.tets.col(tet)).rowwise().mean());
    }
    const WeightedPercentiles at(values, weights);
    report.minimum = values.front();
    report.percentile_1 = at(1.0);
    report.median = at(50.0);
    report.percentile_99 = at(99.0);
    report.maximum = values.back();
    return report;
}

JacobianReport field_jacobians(const Volume& moving_to_fixed, const Volume* mask) {
    if (mask && !imaging::same_grid(mask->geometry, moving_to_fixed.geometry))
        throw InvalidInput("field Jacobians: the mask lies on another grid; resample it onto the grid of the field");
    const Volume determinant = jacobian_determinant(moving_to_fixed);
    const Volume chosen = mask ? Volume(mask->geometry, cv::Mat(mask->voxels != 0)) : Volume();
    const Geometry& grid = determinant.geometry;
    const auto* value = determinant.data<float>();
    std::vector<float> values;
    std::vector<std::int64_t> folded;
    for (std::int64_t n = 0; n < grid.voxel_count(); ++n) {
        if (mask && !chosen.data<std::uint8_t>()[n]) continue;
        if (!std::isfinite(value[n]))
            throw InvalidInput("field Jacobians: the field is not finite around voxel " + std::to_string(n) +
                               "; repair the field");
        values.push_back(value[n]);
        if (value[n] <= 0.0F) folded.push_back(n);
    }
    if (values.empty()) throw InvalidInput("field Jacobians: the mask is empty; give one with voxels");

    JacobianReport report;
    report.folded = static_cast<long long>(folded.size());
    report.folded_mm3 = static_cast<double>(folded.size()) * grid.voxel_volume();
    std::stable_sort(folded.begin(), folded.end(), [&](auto x, auto y) { return value[x] < value[y]; });
    folded.resize(std::min(folded.size(), most_places));
    for (const std::int64_t n : folded) {
        const std::int64_t row = n / grid.size[0];
        report.folded_places.push_back(
            grid.point(Eigen::Array<std::int64_t, 3, 1>(n % grid.size[0], row % grid.size[1], row / grid.size[1])
                           .cast<double>()
                           .matrix()));
    }
    report.minimum = *std::min_element(values.begin(), values.end());
    report.maximum = *std::max_element(values.begin(), values.end());
    report.percentile_1 = percentile(values, 1.0);
    report.median = percentile(values, 50.0);
    report.percentile_99 = percentile(values, 99.0);
    return report;
}

}  // namespace tissuewarp::registration
