#pragma once
/// Where the labels of a map lie, at the price of reading it once.

#include "imaging/volume.hpp"

#include <array>
#include <cstdint>
#include <map>

namespace tissuewarp::imaging {

struct LabelExtent {
    std::int64_t voxels = 0;
    std::array<int, 3> lower{0, 0, 0};  ///< box about them, first voxel
    std::array<int, 3> upper{0, 0, 0};  ///< one past the last
};

/// Of each label but 0, which is background.
using LabelExtents = std::map<int, LabelExtent>;

/// Of a map of integers, in all threads. Throws InvalidInput for other voxels.
LabelExtents label_extents(const Volume& labels);

/// Of all labels together; no voxels where there are none.
LabelExtent extent_of_all(const LabelExtents& extents);

/// The box and `margin` voxels about it along each axis, as far as the image goes.
LabelExtent grown(LabelExtent box, const std::array<int, 3>& margin, const Geometry& grid);

/// The map as int32, of a box every `step`-th voxel along each axis, beginning with the first. Throws InvalidInput for
/// a box without voxels or not in the image.
Volume part_of(const Volume& labels, const LabelExtent& box, const std::array<int, 3>& step = {1, 1, 1});

/// uint8 mask of one label in a box, or of every label where it is 0. Throws InvalidInput as above.
Volume mask_in(const Volume& labels, const LabelExtent& box, int label);

}  // namespace tissuewarp::imaging
