#include "meshing/detail/label_grid.hpp"

#include "core/errors.hpp"

#include <algorithm>
#include <map>
#include <numeric>
#include <set>
#include <string>

namespace tissuewarp::meshing::detail {

namespace {

std::set<int> values_in(const imaging::Volume& labels) {
    std::set<int> values;
    int previous = 0;
    const int* voxel = labels.data<int>();
    for (long long v = 0; v < labels.geometry.voxel_count(); ++v) {
        if (voxel[v] == previous) continue;
        previous = voxel[v];
        values.insert(previous);
    }
    values.erase(0);
    return values;
}

/// Class of each image value that is meshed.
std::map<int, std::uint16_t> number_classes(const imaging::Volume& labels, const std::vector<int>& wanted) {
    const std::set<int> present = values_in(labels);
    if (!present.empty() && *present.begin() < 0)
        throw InvalidInput("mesh_labels: the label map holds the value " + std::to_string(*present.begin()) +
                           "; labels must not be negative");
    for (int label : wanted)
        if (label <= 0 || !present.contains(label))
            throw InvalidInput("mesh_labels: label " + std::to_string(label) +
                               " was requested but no voxel has it; choose labels of the map, background 0 excluded");
    const std::set<int> chosen = wanted.empty() ? present : std::set<int>(wanted.begin(), wanted.end());
    if (chosen.empty()) throw InvalidInput("mesh_labels: the label map is empty; at least one voxel must not be 0");
    if (chosen.size() > 65535)
        throw InvalidInput("mesh_labels: " + std::to_string(chosen.size()) +
                           " labels, at most 65535 can be meshed: this looks like a grey image, not a label map");
    std::map<int, std::uint16_t> classes;
    for (int label : chosen) classes.emplace(label, static_cast<std::uint16_t>(classes.size() + 1));
    return classes;
}

imaging::Volume as_labels(const imaging::Volume& volume) {
    imaging::require_valid(volume.geometry, "label map");
    if (volume.channels() != 1 || volume.voxels.depth() >= CV_32F)
        throw InvalidInput("mesh_labels: the label map must have one channel of integers; convert it to int32");
    return volume.as(CV_32S);
}

}  // namespace

LabelGrid make_label_grid(const imaging::Volume& volume, const std::vector<int>& wanted, int padding) {
    const imaging::Volume labels = as_labels(volume);
    const auto class_of = number_classes(labels, wanted);
    const auto& size = labels.geometry.size;
    LabelGrid grid;
    grid.spacing = labels.geometry.spacing;
    grid.values.assign(class_of.size() + 1, 0);
    for (const auto& [value, index] : class_of) grid.values[index] = value;

    std::array<int, 3> lower = size, upper{-1, -1, -1};
    std::vector<std::uint16_t> classes(static_cast<std::size_t>(labels.geometry.voxel_count()), 0);
    const int* voxel = labels.data<int>();
    int previous = 0;
    std::uint16_t current = 0;
    for (int k = 0; k < size[2]; ++k)
        for (int j = 0; j < size[1]; ++j)
            for (int i = 0; i < size[0]; ++i) {
                const auto v = static_cast<std::size_t>(labels.offset(i, j, k));
                if (voxel[v] != previous) {
                    previous = voxel[v];
                    const auto found = class_of.find(previous);
                    current = found == class_of.end() ? std::uint16_t{0} : found->second;
                }
                if (current == 0) continue;
                classes[v] = current;
                const std::array<int, 3> index{i, j, k};
                for (int axis = 0; axis < 3; ++axis) {
                    lower[axis] = std::min(lower[axis], index[axis]);
                    upper[axis] = std::max(upper[axis], index[axis]);
                }
            }

    for (int axis = 0; axis < 3; ++axis) {
        grid.origin[axis] = lower[axis] - padding;
        grid.size[axis] = upper[axis] - lower[axis] + 1 + 2 * padding;
    }
    grid.classes.assign(static_cast<std::size_t>(grid.size[0]) * static_cast<std::size_t>(grid.size[1]) *
                            static_cast<std::size_t>(grid.size[2]),
                        0);
    for (int k = lower[2]; k <= upper[2]; ++k)
        for (int j = lower[1]; j <= upper[1]; ++j) {
            const auto row = classes.begin() + labels.offset(lower[0], j, k);
            std::copy(row, row + (upper[0] - lower[0] + 1),
                      grid.classes.begin() +
                          static_cast<std::ptrdiff_t>(grid.offset(padding, j - grid.origin[1], k - grid.origin[2])));
        }
    return grid;
}

namespace {

/// Voxels of one class beside each other in a row: [first, end) in voxel order.
struct Run {
    std::size_t first, end;
};

/// Runs row by row, and where those of each row begin; one more at the end.
struct Runs {
    std::vector<Run> runs;
    std::vector<std::size_t> row_begin;
};

Runs runs_of(const LabelGrid& grid, const std::vector<std::uint16_t>& classes) {
    Runs result;
    const auto length = static_cast<std::size_t>(grid.size[0]);
    for (std::size_t row = 0; row < classes.size(); row += length) {
        result.row_begin.push_back(result.runs.size());
        for (std::size_t v = row; v < row + length;) {
            const std::size_t first = v;
            while (++v < row + length && classes[v] == classes[first]) {
            }
            result.runs.push_back({first, v});
        }
    }
    result.row_begin.push_back(result.runs.size());
    return result;
}

/// Union-find whose representative is the first of a set.
class Sets {
public:
    explicit Sets(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), std::size_t{0}); }
    std::size_t first_of(std::size_t a) {
        while (parent_[a] != a) a = parent_[a] = parent_[parent_[a]];
        return a;
    }
    void join(std::size_t a, std::size_t b) {
        const auto [first, second] = std::minmax({first_of(a), first_of(b)});
        parent_[second] = first;
    }

private:
    std::vector<std::size_t> parent_;
};

/// Joins runs of equal class that touch across two rows, `apart` voxels from each other.
void join_rows(const Runs& all, std::size_t row, std::size_t earlier, std::size_t apart,
               const std::vector<std::uint16_t>& classes, Sets& sets) {
    std::size_t a = all.row_begin[row], b = all.row_begin[earlier];
    while (a < all.row_begin[row + 1] && b < all.row_begin[earlier + 1]) {
        if (classes[all.runs[a].first] == classes[all.runs[b].first]) sets.join(a, b);
        const std::size_t end_a = all.runs[a].end, end_b = all.runs[b].end + apart;
        if (end_a <= end_b) ++a;
        if (end_b <= end_a) ++b;
    }
}

}  // namespace

Components connected_components(const LabelGrid& grid, const std::vector<std::uint16_t>& classes) {
    const Runs all = runs_of(grid, classes);
    Sets sets(all.runs.size());
    const auto length = static_cast<std::size_t>(grid.size[0]), rows = static_cast<std::size_t>(grid.size[1]);
    for (std::size_t row = 0; row + 1 < all.row_begin.size(); ++row) {
        if (row % rows > 0) join_rows(all, row, row - 1, length, classes, sets);
        if (row >= rows) join_rows(all, row, row - rows, length * rows, classes, sets);
    }
    Components components;
    components.of_voxel.resize(classes.size());
    std::vector<std::int32_t> number(all.runs.size());
    for (std::size_t r = 0; r < all.runs.size(); ++r) {
        const auto [first, end] = all.runs[r];
        const std::size_t representative = sets.first_of(r);
        if (representative == r) {
            number[r] = static_cast<std::int32_t>(components.class_of.size());
            components.class_of.push_back(classes[first]);
            components.voxels.push_back(0);
        }
        number[r] = number[representative];
        components.voxels[static_cast<std::size_t>(number[r])] += static_cast<std::int64_t>(end - first);
        std::fill(components.of_voxel.begin() + static_cast<std::ptrdiff_t>(first),
                  components.of_voxel.begin() + static_cast<std::ptrdiff_t>(end), number[r]);
    }
    return components;
}

int remove_specks(LabelGrid& grid, const std::vector<double>& voxels) {
    const Components components = connected_components(grid, grid.classes);
    const std::size_t count = components.class_of.size();
    std::vector<std::int64_t> largest(grid.values.size(), 0);
    for (std::size_t c = 0; c < count; ++c) {
        auto& most = largest[components.class_of[c]];
        most = std::max(most, components.voxels[c]);
    }
    std::vector<char> speck(count, 0);
    std::vector<std::map<std::uint16_t, int>> around(count);
    for (std::size_t c = 0; c < count; ++c) {
        const std::uint16_t index = components.class_of[c];
        speck[c] = static_cast<double>(components.voxels[c]) < voxels[index] && components.voxels[c] < largest[index];
    }
    const std::array<std::size_t, 3> stride{1, grid.offset(0, 1, 0), grid.offset(0, 0, 1)};
    for (std::size_t v = 0; v < grid.voxel_count(); ++v) {
        // The padding is one background component, never a speck: neighbours of specks exist.
        const auto c = static_cast<std::size_t>(components.of_voxel[v]);
        if (!speck[c]) continue;
        for (std::size_t step : stride)
            for (std::size_t neighbour : {v - step, v + step}) {
                const auto other = static_cast<std::size_t>(components.of_voxel[neighbour]);
                if (other != c && !speck[other]) ++around[c][components.class_of[other]];
            }
    }
    std::vector<std::uint16_t> heir = components.class_of;
    int removed = 0;
    for (std::size_t c = 0; c < count; ++c) {
        if (!speck[c] || around[c].empty()) continue;
        heir[c] = std::max_element(around[c].begin(), around[c].end(), [](const auto& a, const auto& b) {
                      return a.second < b.second;
                  })->first;
        ++removed;
    }
    for (std::size_t v = 0; v < grid.voxel_count(); ++v)
        grid.classes[v] = heir[static_cast<std::size_t>(components.of_voxel[v])];
    return removed;
}

}  // namespace tissuewarp::meshing::detail
