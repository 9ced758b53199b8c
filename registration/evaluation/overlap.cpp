#include "registration/evaluation.hpp"

#include "core/errors.hpp"
#include "meshing/search/point_tree.hpp"
#include "registration/evaluation/percentile.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_for_each.h>
#include <tbb/parallel_invoke.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace tissuewarp::registration {

namespace {

using detail::percentile;
using imaging::Geometry;
using imaging::Volume;

/// Faces between voxels of a label and others, in the order of the grid, and the number of voxels.
struct Region {
    std::vector<Eigen::Vector3d> centres;  ///< mm along the axes
    std::vector<std::int64_t> places;      ///< 3 · voxel + axis of each
    long long voxels = 0;

    void add(std::int64_t place, const Eigen::Vector3d& centre) {
        places.push_back(place);
        centres.push_back(centre);
    }
};

/// Every label's region, and under key 0 that of all labels together.
class Regions {
public:
    Region& operator[](int label) {
        if (last_ == nullptr || label != label_) last_ = &all_[label_ = label];
        return *last_;
    }
    [[nodiscard]] std::map<int, Region> taken() && { return std::move(all_); }

private:
    std::map<int, Region> all_;
    int label_ = 0;
    Region* last_ = nullptr;  // neighbours in the grid ask for the same one
};

/// Of one slice and its faces to the next.
std::map<int, Region> regions_of_slice(const Volume& labels, int k) {
    Regions regions;
    const Geometry& grid = labels.geometry;
    const std::int64_t per_row = grid.size[0], per_slice = per_row * grid.size[1];
    long long labelled = 0;
    for (int j = 0; j < grid.size[1]; ++j) {
        const std::int64_t first = labels.offset(0, j, k);
        const auto* row = labels.data<std::int32_t>() + first;
        // Beyond the grid itself: no face.
        const auto* beside = j + 1 < grid.size[1] ? row + per_row : row;
        const auto* above = k + 1 < grid.size[2] ? row + per_slice : row;
        for (int i = 0; i < grid.size[0]; ++i) {
            const int here = row[i];
            if (here != 0) {
                ++regions[here].voxels;
                ++labelled;
            }
            const std::array<int, 3> next{row[std::min(i + 1, grid.size[0] - 1)], beside[i], above[i]};
            if (next[0] == here && next[1] == here && next[2] == here) continue;
            for (int axis = 0; axis < 3; ++axis) {
                const int there = next[static_cast<std::size_t>(axis)];
                if (there == here) continue;
                Eigen::Vector3d centre(i, j, k);
                centre[axis] += 0.5;
                centre = centre.cwiseProduct(grid.spacing);
                const std::int64_t place = 3 * (first + i) + axis;
                if (here != 0) regions[here].add(place, centre);
                if (there != 0) regions[there].add(place, centre);
                if (here == 0 || there == 0) regions[0].add(place, centre);
            }
        }
    }
    if (labelled > 0) regions[0].voxels = labelled;
    return std::move(regions).taken();
}

std::map<int, Region> regions_of(const Volume& labels) {
    std::vector<std::map<int, Region>> slices(static_cast<std::size_t>(labels.geometry.size[2]));
    tbb::parallel_for(0, labels.geometry.size[2],
                      [&](int k) { slices[static_cast<std::size_t>(k)] = regions_of_slice(labels, k); });
    std::map<int, Region> regions;
    for (const auto& slice : slices)
        for (const auto& [label, part] : slice) {
            Region& region = regions[label];
            region.centres.insert(region.centres.end(), part.centres.begin(), part.centres.end());
            region.places.insert(region.places.end(), part.places.begin(), part.places.end());
            region.voxels += part.voxels;
        }
    return regions;
}

/// Which faces of a grid are those of a region.
class FaceSet {
public:
    FaceSet(const Region& region, const Geometry& grid)
        : grid_(grid), bits_(static_cast<std::size_t>(3 * grid.voxel_count() / 64 + 1)) {
        for (const std::int64_t place : region.places) word(place) |= bit(place);
    }

    /// From the face at a place to the nearest, mm; nothing where that lies farther than a few voxels.
    [[nodiscard]] std::optional<double> distance(std::int64_t place, const Eigen::Vector3d& centre) const {
        constexpr int farthest = 4;
        const std::int64_t voxel = place / 3, row = grid_.size[0];
        const std::array<int, 3> at{int(voxel % row), int(voxel / row % grid_.size[1]),
                                    int(voxel / row / grid_.size[1])};
        double squared = std::numeric_limits<double>::infinity();
        for (int reach = 0; reach <= farthest; ++reach) {
            look(at, reach, centre, squared);
            const double beyond = (reach + 0.5) * grid_.spacing.minCoeff();  // of faces that were not looked at
            if (squared <= beyond * beyond) return std::sqrt(squared);
        }
        return std::nullopt;
    }

private:
    const Geometry& grid_;
    std::vector<std::uint64_t> bits_;

    [[nodiscard]] std::uint64_t& word(std::int64_t place) { return bits_[static_cast<std::size_t>(place / 64)]; }
    [[nodiscard]] static std::uint64_t bit(std::int64_t place) { return std::uint64_t{1} << (place % 64); }
    [[nodiscard]] bool holds(std::int64_t place) const {
        return (bits_[static_cast<std::size_t>(place / 64)] & bit(place)) != 0;
    }

    /// At the faces of voxels `reach` steps away along the axis where they are farthest.
    void look(const std::array<int, 3>& at, int reach, const Eigen::Vector3d& from, double& squared) const {
        const auto first = [&](std::size_t axis) { return std::max(0, at[axis] - reach); };
        const auto last = [&](std::size_t axis) { return std::min(grid_.size[axis] - 1, at[axis] + reach); };
        for (int k = first(2); k <= last(2); ++k)
            for (int j = first(1); j <= last(1); ++j) {
                const bool whole = std::abs(k - at[2]) == reach || std::abs(j - at[1]) == reach;
                for (int i = first(0); i <= last(0); i += whole || reach == 0 ? 1 : 2 * reach) {
                    if (!whole && std::abs(i - at[0]) != reach) continue;
                    const std::int64_t place = 3 * (i + grid_.size[0] * (j + std::int64_t{grid_.size[1]} * k));
                    for (int axis = 0; axis < 3; ++axis) {
                        if (!holds(place + axis)) continue;
                        Eigen::Vector3d centre(i, j, k);
                        centre[axis] += 0.5;
                        squared = std::min(squared, (centre.cwiseProduct(grid_.spacing) - from).squaredNorm());
                    }
                }
            }
    }
};

/// From each face of a region to the nearest of another, mm. Most are of both or lie a voxel apart, where labels nearly
/// agree; those that lie farther are asked of a tree.
std::vector<double> distances(const Region& from, const Region& to, const Geometry& grid) {
    constexpr double far = -1;
    std::vector<double> result(from.places.size(), 0.0);
    std::vector<std::size_t> apart;
    auto same = to.places.begin();
    for (std::size_t n = 0; n < from.places.size(); ++n) {
        while (same != to.places.end() && *same < from.places[n]) ++same;
        if (same == to.places.end() || *same != from.places[n]) apart.push_back(n);
    }
    if (apart.empty()) return result;
    const FaceSet faces(to, grid);
    tbb::parallel_for(std::size_t{0}, apart.size(), [&](std::size_t n) {
        const std::size_t face = apart[n];
        result[face] = faces.distance(from.places[face], from.centres[face]).value_or(far);
    });
    std::erase_if(apart, [&](std::size_t face) { return result[face] != far; });
    if (apart.empty()) return result;
    const meshing::PointTree tree(to.centres);
    tbb::parallel_for(std::size_t{0}, apart.size(),
                      [&](std::size_t n) { result[apart[n]] = tree.distance(from.centres[apart[n]]); });
    return result;
}

void measure_surfaces(const Region& a, const Region& b, const Geometry& grid, Overlap& overlap) {
    if (a.places.empty() && b.places.empty() && overlap.dice == 1.0) return;  // both fill the image
    if (a.places.empty() || b.places.empty()) {
        overlap.mean_surface_distance_mm = overlap.hausdorff_95_mm = std::numeric_limits<double>::infinity();
        return;
    }
    std::vector<double> to_b, to_a;
    tbb::parallel_invoke([&] { to_b = distances(a, b, grid); }, [&] { to_a = distances(b, a, grid); });
    const auto mean = [](const std::vector<double>& d) {
        return std::accumulate(d.begin(), d.end(), 0.0) / static_cast<double>(d.size());
    };
    overlap.mean_surface_distance_mm = 0.5 * (mean(to_a) + mean(to_b));
    overlap.hausdorff_95_mm = std::max(percentile(to_a, 95.0), percentile(to_b, 95.0));
}

/// Voxels that have the same label in both, and under key 0 any label.
std::map<int, long long> voxels_in_both(const Volume& a, const Volume& b) {
    using Counts = std::map<int, long long>;
    const auto *in_a = a.data<std::int32_t>(), *in_b = b.data<std::int32_t>();
    const auto count = [&](const tbb::blocked_range<std::int64_t>& voxels, Counts common) {
        for (std::int64_t n = voxels.begin(); n < voxels.end();) {  // by runs, since a map is slow to ask
            const std::int64_t first = n;
            while (n < voxels.end() && in_a[n] == in_a[first] && in_b[n] == in_b[first]) ++n;
            if (in_a[first] == 0 || in_b[first] == 0) continue;
            common[0] += n - first;
            if (in_a[first] == in_b[first]) common[in_a[first]] += n - first;
        }
        return common;
    };
    const auto together = [](Counts common, const Counts& more) {
        for (const auto& [label, voxels] : more) common[label] += voxels;
        return common;
    };
    constexpr std::int64_t piece = 1 << 16;
    return tbb::parallel_reduce(tbb::blocked_range<std::int64_t>(0, a.geometry.voxel_count(), piece), Counts(), count,
                                together);
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
    std::map<int, long long> common = voxels_in_both(a, b);
    std::map<int, Region> regions_a, regions_b;
    tbb::parallel_invoke([&] { regions_a = regions_of(a); }, [&] { regions_b = regions_of(b); });
    for (const auto& [label, region] : regions_a) regions_b[label];
    std::map<int, Overlap> result;
    for (const auto& [label, region_b] : regions_b) {
        const Region& region_a = regions_a[label];
        result[label].dice =
            2.0 * static_cast<double>(common[label]) / static_cast<double>(region_a.voxels + region_b.voxels);
    }
    tbb::parallel_for_each(result, [&](auto& entry) {
        measure_surfaces(regions_a.at(entry.first), regions_b.at(entry.first), reference.geometry, entry.second);
    });
    return result;
}

}  // namespace tissuewarp::registration
