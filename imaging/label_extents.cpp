#include "imaging/label_extents.hpp"

#include "core/errors.hpp"
#include "imaging/voxel_type.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>

namespace tissuewarp::imaging {

namespace {

void add(LabelExtent& extent, const LabelExtent& more) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
        extent.lower[axis] = extent.voxels == 0 ? more.lower[axis] : std::min(extent.lower[axis], more.lower[axis]);
        extent.upper[axis] = std::max(extent.upper[axis], more.upper[axis]);
    }
    extent.voxels += more.voxels;
}

template <class Call>
auto with_integers(const Volume& labels, const Call& call) {
    if (labels.empty() || labels.channels() != 1)
        throw InvalidInput("label map: voxels must be integers of one component; read it with read_labels");
    return with_integer_type(labels, "label map", call);
}

Geometry grid_of(const Geometry& image, const LabelExtent& box, const std::array<int, 3>& step) {
    Geometry grid = image;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        if (box.lower[axis] < 0 || box.upper[axis] > image.size[axis] || box.lower[axis] >= box.upper[axis])
            throw InvalidInput("label map: a box without voxels, or beyond the image");
        grid.size[axis] = (box.upper[axis] - box.lower[axis] + step[axis] - 1) / step[axis];
        grid.spacing[static_cast<Eigen::Index>(axis)] *= step[axis];
    }
    grid.origin = image.point(Eigen::Vector3d(box.lower[0], box.lower[1], box.lower[2]));
    return grid;
}

/// row(from, to) for every row of a part: its first voxel in the map, and its place in the part.
template <typename T, class Row>
void each_row(const Volume& labels, const LabelExtent& box, const std::array<int, 3>& step, const Geometry& part,
              const Row& row) {
    tbb::parallel_for(0, part.size[2], [&](int k) {
        for (int j = 0; j < part.size[1]; ++j)
            row(labels.data<T>() + labels.offset(box.lower[0], box.lower[1] + j * step[1], box.lower[2] + k * step[2]),
                part.size[0] * (j + std::int64_t{part.size[1]} * k));
    });
}

template <typename T>
LabelExtents extents_of(const Volume& labels) {
    const std::array<int, 3>& size = labels.geometry.size;
    const auto add_slices = [&](const tbb::blocked_range<int>& slices, LabelExtents extents) {
        for (int k = slices.begin(); k < slices.end(); ++k)
            for (int j = 0; j < size[1]; ++j) {
                const T* row = labels.data<T>() + labels.offset(0, j, k);
                for (int i = 0; i < size[0];) {
                    const int first = i;
                    while (i < size[0] && row[i] == row[first]) ++i;
                    if (row[first] != 0) add(extents[int(row[first])], {i - first, {first, j, k}, {i, j + 1, k + 1}});
                }
            }
        return extents;
    };
    const auto together = [](LabelExtents extents, const LabelExtents& more) {
        for (const auto& [label, extent] : more) add(extents[label], extent);
        return extents;
    };
    return tbb::parallel_reduce(tbb::blocked_range<int>(0, size[2]), LabelExtents(), add_slices, together);
}

}  // namespace

LabelExtents label_extents(const Volume& labels) {
    return with_integers(labels, [&](auto type) { return extents_of<decltype(type)>(labels); });
}

LabelExtent extent_of_all(const LabelExtents& extents) {
    LabelExtent all;
    for (const auto& [label, extent] : extents) add(all, extent);
    return all;
}

LabelExtent grown(LabelExtent box, const std::array<int, 3>& margin, const Geometry& grid) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
        box.lower[axis] = std::max(0, box.lower[axis] - margin[axis]);
        box.upper[axis] = std::min(grid.size[axis], box.upper[axis] + margin[axis]);
    }
    return box;
}

Volume part_of(const Volume& labels, const LabelExtent& box, const std::array<int, 3>& step) {
    Volume part(grid_of(labels.geometry, box, step), CV_32SC1);
    with_integers(labels, [&](auto type) {
        each_row<decltype(type)>(labels, box, step, part.geometry, [&](const auto* from, std::int64_t to) {
            auto* row = part.data<std::int32_t>() + to;
            for (int i = 0; i < part.geometry.size[0]; ++i) row[i] = static_cast<std::int32_t>(from[i * step[0]]);
        });
        return 0;
    });
    return part;
}

Volume mask_in(const Volume& labels, const LabelExtent& box, int label) {
    constexpr std::array<int, 3> every{1, 1, 1};
    Volume mask(grid_of(labels.geometry, box, every), CV_8UC1);
    with_integers(labels, [&](auto type) {
        each_row<decltype(type)>(labels, box, every, mask.geometry, [&](const auto* from, std::int64_t to) {
            auto* row = mask.data<std::uint8_t>() + to;
            for (int i = 0; i < mask.geometry.size[0]; ++i)
                row[i] = label == 0 ? from[i] != 0 : static_cast<std::int32_t>(from[i]) == label;
        });
        return 0;
    });
    return mask;
}

}  // namespace tissuewarp::imaging
