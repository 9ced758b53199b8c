#include "meshing/detail/label_field.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

namespace tissuewarp::meshing::detail {

namespace {

/// Sampled Gaussian, cut at 2.5 standard deviations; its sum is 1.
std::vector<float> gaussian(double sigma) {
    const int radius = sigma > 0.0 ? std::max(1, static_cast<int>(std::ceil(2.5 * sigma))) : 0;
    std::vector<float> weights;
    float sum = 0.0F;
    for (int x = -radius; x <= radius; ++x) {
        weights.push_back(radius == 0 ? 1.0F : static_cast<float>(std::exp(-0.5 * x * x / (sigma * sigma))));
        sum += weights.back();
    }
    for (float& weight : weights) weight /= sum;
    return weights;
}

/// The smallest or the largest of each value and those up to `radius` before and after it, `stride` apart, along rows
/// of `length`; each call takes `width` rows beside each other.
template <class Choose>
void spread(const std::uint16_t* source, std::uint16_t* values, int length, std::size_t stride, std::size_t width,
            int radius, const Choose& choose) {
    for (int at = 0; at < length; ++at) {
        std::uint16_t* row = values + static_cast<std::size_t>(at) * stride;
        for (int x = std::max(-radius, -at); x <= std::min(radius, length - 1 - at); ++x) {
            const std::uint16_t* neighbour = source + static_cast<std::size_t>(at + x) * stride;
            for (std::size_t v = 0; v < width; ++v) row[v] = choose(row[v], neighbour[v]);
        }
    }
}

/// Over boxes of ± radius, one axis after the other.
template <class Choose>
std::vector<std::uint16_t> spread_in_boxes(const LabelGrid& grid, int radius, const Choose& choose) {
    const auto nx = static_cast<std::size_t>(grid.size[0]), slice = grid.offset(0, 0, 1);
    std::vector<std::uint16_t> values = grid.classes, source = values;
    const auto next_axis = [&](int count, const auto& along) {
        tbb::parallel_for(0, count, along);
        source = values;
    };
    next_axis(grid.size[1] * grid.size[2], [&](int row) {
        const std::size_t at = nx * static_cast<std::size_t>(row);
        spread(&source[at], &values[at], grid.size[0], 1, 1, radius, choose);
    });
    next_axis(grid.size[2], [&](int k) {
        const std::size_t at = slice * static_cast<std::size_t>(k);
        spread(&source[at], &values[at], grid.size[1], nx, nx, radius, choose);
    });
    tbb::parallel_for(0, grid.size[1], [&](int j) {
        const std::size_t at = nx * static_cast<std::size_t>(j);
        spread(&source[at], &values[at], grid.size[2], slice, nx, radius, choose);
    });
    return values;
}

/// 1 where the box of ± radius around a voxel holds more than one class: where the smallest and the largest differ.
std::vector<char> mixed_voxels(const LabelGrid& grid, int radius) {
    const auto low = spread_in_boxes(grid, radius, [](std::uint16_t a, std::uint16_t b) { return std::min(a, b); });
    const auto high = spread_in_boxes(grid, radius, [](std::uint16_t a, std::uint16_t b) { return std::max(a, b); });
    std::vector<char> mixed(grid.voxel_count());
    for (std::size_t v = 0; v < mixed.size(); ++v) mixed[v] = low[v] != high[v];
    return mixed;
}

/// Weights of the voxels of the box of ± radius, rows of x in slices of y.
std::vector<float> box_weights(const std::vector<float>& kernel) {
    std::vector<float> weights;
    for (const float z : kernel)
        for (const float y : kernel)
            for (const float x : kernel) weights.push_back(x * y * z);
    return weights;
}

}  // namespace

LabelField::LabelField(const LabelGrid& grid, double smoothing)
    : size_(grid.size), spacing_(grid.spacing), centre_class_(grid.classes) {
    smooth(grid, smoothing);
    if (smoothing > 0.0) keep_thin_pieces(grid);
    for (std::size_t v = 0; v < list_.size(); ++v)
        if (list_[v] >= 0) centre_class_[v] = strongest(list_[v]);
}

void LabelField::smooth(const LabelGrid& grid, double smoothing) {
    const std::vector<float> kernel = gaussian(smoothing), weights = box_weights(kernel);
    const int radius = static_cast<int>(kernel.size() / 2);
    const std::vector<char> mixed = mixed_voxels(grid, std::max(radius, 1));
    list_.assign(grid.voxel_count(), -1);

    // One part per slice, joined in order, so that the result does not depend on the number of threads.
    struct Part {
        std::vector<std::int64_t> length;
        std::vector<Entry> entries;
    };
    std::vector<Part> parts(static_cast<std::size_t>(size_[2]));
    tbb::parallel_for(0, size_[2], [&](int k) {
        Part& part = parts[static_cast<std::size_t>(k)];
        std::vector<Entry> list;
        for (int j = 0; j < size_[1]; ++j)
            for (int i = 0; i < size_[0]; ++i) {
                if (!mixed[grid.offset(i, j, k)]) continue;
                list.clear();
                std::size_t last = 0;  // neighbours mostly share their class
                const auto add = [&](std::uint16_t index, float weight) {
                    if (last < list.size() && list[last].index == index) {
                        list[last].weight += weight;
                        return;
                    }
                    for (last = 0; last < list.size(); ++last)
                        if (list[last].index == index) {
                            list[last].weight += weight;
                            return;
                        }
                    list.push_back({index, weight});
                };
                const float* weight = weights.data();
                for (int z = -radius; z <= radius; ++z)
                    for (int y = -radius; y <= radius; ++y) {
                        const int b = j + y, c = k + z;
                        const bool row_inside = b >= 0 && c >= 0 && b < size_[1] && c < size_[2];
                        const std::uint16_t* row = row_inside ? &grid.classes[grid.offset(0, b, c)] : nullptr;
                        for (int x = -radius; x <= radius; ++x, ++weight) {
                            const int a = i + x;
                            add(row != nullptr && a >= 0 && a < size_[0] ? row[a] : std::uint16_t{0}, *weight);
                        }
                    }
                part.length.push_back(static_cast<std::int64_t>(list.size()));
                part.entries.insert(part.entries.end(), list.begin(), list.end());
            }
    });
    start_.assign(1, 0);
    for (const Part& part : parts) {
        for (std::int64_t length : part.length) start_.push_back(start_.back() + length);
        entries_.insert(entries_.end(), part.entries.begin(), part.entries.end());
    }
    std::int32_t next = 0;
    for (std::size_t v = 0; v < list_.size(); ++v)
        if (mixed[v]) list_[v] = next++;
}

std::uint16_t LabelField::strongest(std::int32_t list) const {
    const auto at = static_cast<std::size_t>(list);
    const Entry* best = &entries_[static_cast<std::size_t>(start_[at])];
    for (auto e = static_cast<std::size_t>(start_[at]); e < static_cast<std::size_t>(start_[at + 1]); ++e) {
        const Entry& entry = entries_[e];
        if (entry.weight > best->weight || (entry.weight == best->weight && entry.index < best->index)) best = &entry;
    }
    return best->index;
}

void LabelField::keep_thin_pieces(const LabelGrid& grid) {
    const Components components = connected_components(grid, grid.classes);
    std::vector<std::int64_t> lost(components.class_of.size(), 0);
    for (std::size_t v = 0; v < list_.size(); ++v)
        if (list_[v] >= 0 && strongest(list_[v]) != grid.classes[v])
            ++lost[static_cast<std::size_t>(components.of_voxel[v])];
    for (std::size_t v = 0; v < list_.size(); ++v) {
        const auto c = static_cast<std::size_t>(components.of_voxel[v]);
        if (list_[v] < 0 || grid.classes[v] == 0 || 6 * lost[c] < components.voxels[c]) continue;
        const std::uint16_t winner = strongest(list_[v]);
        if (winner == grid.classes[v]) continue;
        // A lead of one half puts the interface about halfway to a neighbour where smoothing leaves the opposite lead,
        // so that a membrane of one voxel keeps about its thickness.
        float* own = nullptr;
        float largest = 0.0F;
        const auto at = static_cast<std::size_t>(list_[v]);
        for (auto e = static_cast<std::size_t>(start_[at]); e < static_cast<std::size_t>(start_[at + 1]); ++e) {
            largest = std::max(largest, entries_[e].weight);
            if (entries_[e].index == grid.classes[v]) own = &entries_[e].weight;
        }
        if (own) *own = largest + 0.5F;
    }
}

int LabelField::operator()(const Eigen::Array3d& point) const {
    const Eigen::Array3d index = point / spacing_;
    std::array<int, 3> cell;
    std::array<float, 3> fraction;
    for (int axis = 0; axis < 3; ++axis) {
        if (!(index[axis] >= 0.0 && index[axis] < size_[axis] - 1)) return 0;
        cell[axis] = static_cast<int>(index[axis]);
        fraction[axis] = static_cast<float>(index[axis] - cell[axis]);
    }
    const std::size_t row = static_cast<std::size_t>(size_[0]), slice = row * static_cast<std::size_t>(size_[1]);
    const std::size_t base = static_cast<std::size_t>(cell[0]) + row * static_cast<std::size_t>(cell[1]) +
                             slice * static_cast<std::size_t>(cell[2]);
    const std::array<std::size_t, 8> corner{base,         base + 1,         base + row,         base + row + 1,
                                            base + slice, base + slice + 1, base + slice + row, base + slice + row + 1};
    bool uniform = true;
    for (std::size_t v : corner) uniform = uniform && list_[v] < 0 && centre_class_[v] == centre_class_[base];
    if (uniform) return centre_class_[base];

    constexpr int capacity = 32;  // distinct classes around one cell; further ones, never seen, are ignored
    std::array<Entry, capacity> sums;
    int count = 0;
    const auto add = [&](std::uint16_t label, float weight) {
        for (int s = 0; s < count; ++s)
            if (sums[s].index == label) {
                sums[s].weight += weight;
                return;
            }
        if (count < capacity) sums[count++] = {label, weight};
    };
    for (int c = 0; c < 8; ++c) {
        const float share = ((c & 1) ? fraction[0] : 1.0F - fraction[0]) *
                            ((c & 2) ? fraction[1] : 1.0F - fraction[1]) * ((c & 4) ? fraction[2] : 1.0F - fraction[2]);
        const std::int32_t list = list_[corner[c]];
        if (list < 0) {
            add(centre_class_[corner[c]], share);
            continue;
        }
        const auto at = static_cast<std::size_t>(list);
        for (auto e = static_cast<std::size_t>(start_[at]); e < static_cast<std::size_t>(start_[at + 1]); ++e)
            add(entries_[e].index, share * entries_[e].weight);
    }
    const Entry* best = sums.data();
    for (int s = 1; s < count; ++s)
        if (sums[s].weight > best->weight || (sums[s].weight == best->weight && sums[s].index < best->index))
            best = &sums[s];
    return best->index;
}

}  // namespace tissuewarp::meshing::detail
