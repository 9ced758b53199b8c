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

/// 1 where the box of ± radius around a voxel holds more than one class; row, column, slice in turn. A voxel is pure
/// when the smallest and the largest class of its box agree.
std::vector<char> mixed_voxels(const LabelGrid& grid, int radius) {
    std::vector<std::uint16_t> low = grid.classes, high = grid.classes, source;
    const std::array<std::size_t, 3> stride{1, grid.offset(0, 1, 0), grid.offset(0, 0, 1)};
    const auto slice = stride[2];
    for (int axis = 0; axis < 3; ++axis) {
        for (const bool maximum : {false, true}) {
            auto& values = maximum ? high : low;
            source = values;
            tbb::parallel_for(0, grid.size[2], [&](int k) {
                for (std::size_t v = slice * static_cast<std::size_t>(k); v < slice * static_cast<std::size_t>(k + 1);
                     ++v) {
                    const int at = static_cast<int>(v / stride[axis] % static_cast<std::size_t>(grid.size[axis]));
                    for (int x = std::max(-radius, -at); x <= std::min(radius, grid.size[axis] - 1 - at); ++x) {
                        const auto neighbour = static_cast<std::size_t>(static_cast<std::ptrdiff_t>(v) +
                                                                        x * static_cast<std::ptrdiff_t>(stride[axis]));
                        values[v] =
                            maximum ? std::max(values[v], source[neighbour]) : std::min(values[v], source[neighbour]);
                    }
                }
            });
        }
    }
    std::vector<char> mixed(grid.voxel_count());
    for (std::size_t v = 0; v < mixed.size(); ++v) mixed[v] = low[v] != high[v];
    return mixed;
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
    const std::vector<float> kernel = gaussian(smoothing);
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
                const auto add = [&](std::uint16_t index, float weight) {
                    for (Entry& entry : list)
                        if (entry.index == index) {
                            entry.weight += weight;
                            return;
                        }
                    list.push_back({index, weight});
                };
                for (int z = -radius; z <= radius; ++z)
                    for (int y = -radius; y <= radius; ++y)
                        for (int x = -radius; x <= radius; ++x) {
                            const int a = i + x, b = j + y, c = k + z;
                            const bool inside =
                                a >= 0 && b >= 0 && c >= 0 && a < size_[0] && b < size_[1] && c < size_[2];
                            add(inside ? grid.classes[grid.offset(a, b, c)] : std::uint16_t{0},
                                kernel[static_cast<std::size_t>(x + radius)] *
                                    kernel[static_cast<std::size_t>(y + radius)] *
                                    kernel[static_cast<std::size_t>(z + radius)]);
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
