#include "registration/evaluation.hpp"

#include "core/errors.hpp"
#include "meshing/search/point_tree.hpp"
#include "registration/evaluation/percentile.hpp"

#include <tbb/parallel_for.h>

#include <array>
#include <limits>
#include <numeric>
#include <string>

namespace tissuewarp::registration {

namespace {

using detail::percentile;
using imaging::Geometry;
using imaging::Volume;

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

std::vector<double> distances(const std::vector<Eigen::Vector3d>& from, const meshing::PointTree& to) {
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
    std::vector<double> to_b = distances(a.faces, meshing::PointTree(b.faces));
    std::vector<double> to_a = distances(b.faces, meshing::PointTree(a.faces));
    const auto mean = [](const std::vector<double>& d) {
        return std::accumulate(d.begin(), d.end(), 0.0) / static_cast<double>(d.size());
    };
    overlap.mean_surface_distance_mm = 0.5 * (mean(to_a) + mean(to_b));
    overlap.hausdorff_95_mm = std::max(percentile(to_a, 95.0), percentile(to_b, 95.0));
}

}  // namespace

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

}  // namespace tissuewarp::registration
