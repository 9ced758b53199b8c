#include "registration/matching/descriptors/matching_grid.hpp"
#include "registration/matching/descriptors/matching_image.hpp"

#include <tbb/parallel_for.h>

#include <utility>

namespace tissuewarp::registration::detail {

using imaging::Volume;

namespace {

/// Rows of a volume and their neighbours along an axis, borders replicated: calls visit(first, count, before, after)
/// for runs of voxels whose neighbours lie at the same distances.
template <class Visit>
void along_axis(const Volume& image, std::size_t axis, const Visit& visit) {
    const auto& size = image.geometry.size;
    const std::array<std::ptrdiff_t, 3> strides{1, size[0], std::ptrdiff_t{size[0]} * size[1]};
    tbb::parallel_for(0, size[2], [&](int k) {
        for (int j = 0; j < size[1]; ++j) {
            const std::ptrdiff_t row = image.offset(0, j, k), width = size[0];
            if (axis > 0) {
                const int at = axis == 1 ? j : k;
                visit(row, width, at > 0 ? -strides[axis] : 0, at + 1 < size[axis] ? strides[axis] : 0);
                continue;
            }
            visit(row, 1, 0, width > 1 ? 1 : 0);
            if (width > 2) visit(row + 1, width - 2, -1, 1);
            if (width > 1) visit(row + width - 1, 1, -1, 0);
        }
    });
}

/// to = from of three voxels, or the values of the middle one and one beside it differ.
void differ(const Volume& image, std::size_t axis, const std::uint8_t* from, std::uint8_t* __restrict to) {
    const float* value = image.data<float>();
    along_axis(image, axis,
               [&](std::ptrdiff_t first, std::ptrdiff_t count, std::ptrdiff_t before, std::ptrdiff_t after) {
                   const float* const v = value + first;
                   const std::uint8_t* const f = from + first;
                   std::uint8_t* __restrict const t = to + first;
                   for (std::ptrdiff_t n = 0; n < count; ++n)
                       t[n] = static_cast<std::uint8_t>(f[n + before] | f[n] | f[n + after] | (v[n + before] != v[n]) |
                                                        (v[n + after] != v[n]));
               });
}

/// to = all three voxels.
void all(const Volume& image, std::size_t axis, const std::uint8_t* from, std::uint8_t* __restrict to) {
    along_axis(image, axis,
               [&](std::ptrdiff_t first, std::ptrdiff_t count, std::ptrdiff_t before, std::ptrdiff_t after) {
                   const std::uint8_t* const f = from + first;
                   std::uint8_t* __restrict const t = to + first;
                   for (std::ptrdiff_t n = 0; n < count; ++n)
                       t[n] = static_cast<std::uint8_t>(f[n + before] & f[n] & f[n + after]);
               });
}

/// Of a scalar image in memory of its own; doubles may overflow.
Volume as_floats(const Volume& given, SeenMemory& memory) {
    if (given.empty() || given.channels() != 1 || given.voxels.depth() == CV_32F) return given.as(CV_32F);
    memory.image.create(3, given.voxels.size.p, CV_32FC1);
    const cv::Mat from = given.voxels.reshape(0, given.voxels.size[0]),
                  to = memory.image.reshape(0, given.voxels.size[0]);
    tbb::parallel_for(0, from.rows, [&](int k) {
        cv::Mat row = to.row(k);
        from.row(k).convertTo(row, CV_32F);
    });
    return {given.geometry, memory.image};
}

/// to = the voxel beside one along i has another value: where nothing is known before.
void differ_along_i(const Volume& image, std::uint8_t* __restrict to) {
    const float* value = image.data<float>();
    along_axis(image, 0, [&](std::ptrdiff_t first, std::ptrdiff_t count, std::ptrdiff_t before, std::ptrdiff_t after) {
        const float* const v = value + first;
        std::uint8_t* __restrict const t = to + first;
        for (std::ptrdiff_t n = 0; n < count; ++n)
            t[n] = static_cast<std::uint8_t>((v[n + before] != v[n]) | (v[n + after] != v[n]));
    });
}

}  // namespace

Volume seen_region(const Volume& image) {
    SeenMemory memory;
    return seen_region(image, memory);
}

Volume seen_region(const Volume& image, SeenMemory& memory) {
    const auto voxels = static_cast<std::size_t>(image.geometry.voxel_count());
    memory.one.resize(voxels);
    memory.other.resize(voxels);
    std::uint8_t *const one = memory.one.data(), *const other = memory.other.data();
    memory.seen.create(3, image.voxels.size.p, CV_8UC1);
    Volume seen(image.geometry, memory.seen);
    // A cube is of one value when its three slices are, and their centres agree.
    differ_along_i(image, one);
    differ(image, 1, one, other);
    differ(image, 2, other, one);
    all(image, 0, one, other);
    all(image, 1, other, one);
    all(image, 2, one, seen.data<std::uint8_t>());
    return seen;
}

SeenImage::SeenImage(const Volume& given) {
    SeenMemory memory;
    *this = SeenImage(given, memory);
}

SeenImage::SeenImage(const Volume& given, SeenMemory& memory, const std::function<void(const Volume&)>& converted) {
    image = as_floats(given, memory);
    if (given.empty() || given.channels() != 1 || given.voxels.depth() >= CV_32F)  // whole numbers are finite
        require_finite(image, "block matching: the fixed image");
    converted(image);
    seen = seen_region(image, memory);
}

}  // namespace tissuewarp::registration::detail
