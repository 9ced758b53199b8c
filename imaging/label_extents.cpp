#include "imaging/label_extents.hpp"

#include "core/errors.hpp"
#include "imaging/filters.hpp"

#include <tbb/blocked_range.h>
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
    if (labels.empty() || labels.channels() != 1)
        throw InvalidInput("label map: voxels must be integers of one component; read it with read_labels");
    switch (labels.voxels.depth()) {
        case CV_8U:
            return extents_of<std::uint8_t>(labels);
        case CV_8S:
            return extents_of<std::int8_t>(labels);
        case CV_16U:
            return extents_of<std::uint16_t>(labels);
        case CV_16S:
            return extents_of<std::int16_t>(labels);
        case CV_32S:
            return extents_of<std::int32_t>(labels);
        default:
            throw InvalidInput("label map: voxels must be integers of one component; read it with read_labels");
    }
}

LabelExtent extent_of_all(const LabelExtents& extents) {
    LabelExtent all;
    for (const auto& [label, extent] : extents) add(all, extent);
    return all;
}

Volume trimmed(const Volume& labels, const LabelExtent& box, int margin) {
    std::array<int, 3> lower{}, upper{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        lower[axis] = std::max(0, box.lower[axis] - margin);
        upper[axis] = std::min(labels.geometry.size[axis], box.upper[axis] + margin);
    }
    return crop(labels, lower, upper).as(CV_32S);
}

}  // namespace tissuewarp::imaging
