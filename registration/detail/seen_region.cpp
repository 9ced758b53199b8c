#include "registration/detail/matching_image.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>

namespace tissuewarp::registration::detail {

using imaging::Volume;

namespace {

/// to(n) = combine(n, before, after) for every voxel n and its neighbours along an axis, borders replicated.
template <class Combine>
std::vector<std::uint8_t> along_axis(const Volume& image, const std::vector<std::uint8_t>& from, std::size_t axis,
                                     const Combine& combine) {
    const auto& size = image.geometry.size;
    const std::array<std::ptrdiff_t, 3> strides{1, size[0], std::ptrdiff_t{size[0]} * size[1]};
    const std::ptrdiff_t stride = strides[axis];
    std::vector<std::uint8_t> to(from.size());
    tbb::parallel_for(0, size[2], [&](int k) {
        for (int j = 0; j < size[1]; ++j) {
            const std::ptrdiff_t row = image.offset(0, j, k);
            const int at = axis == 1 ? j : k;
            const auto run = [&](int first, int last, std::ptrdiff_t before, std::ptrdiff_t after) {
                for (std::ptrdiff_t n = row + first; n < row + last; ++n)
                    to[static_cast<std::size_t>(n)] = combine(n, n + before, n + after);
            };
            if (axis > 0) {
                run(0, size[0], at > 0 ? -stride : 0, at + 1 < size[axis] ? stride : 0);
                continue;
            }
            run(0, 1, 0, size[0] > 1 ? 1 : 0);
            run(1, size[0] - 1, -1, 1);
            if (size[0] > 1) run(size[0] - 1, size[0], -1, 0);
        }
    });
    return to;
}

}  // namespace

Volume seen_region(const Volume& image) {
    const float* value = image.data<float>();
    const auto at = [](const std::vector<std::uint8_t>& bytes, std::ptrdiff_t n) {
        return bytes[static_cast<std::size_t>(n)];
    };
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(image.geometry.voxel_count()), 1);
    // A cube is of one value when its three slices are, and their centres agree.
    for (std::size_t axis = 0; axis < 3; ++axis)
        bytes = along_axis(image, bytes, axis, [&](std::ptrdiff_t n, std::ptrdiff_t before, std::ptrdiff_t after) {
            return static_cast<std::uint8_t>(at(bytes, before) & at(bytes, n) & at(bytes, after) &
                                             (value[before] == value[n]) & (value[after] == value[n]));
        });
    for (std::size_t axis = 0; axis < 3; ++axis)
        bytes = along_axis(image, bytes, axis, [&](std::ptrdiff_t n, std::ptrdiff_t before, std::ptrdiff_t after) {
            return static_cast<std::uint8_t>(at(bytes, before) | at(bytes, n) | at(bytes, after));
        });
    Volume seen(image.geometry, CV_8UC1);
    std::transform(bytes.begin(), bytes.end(), seen.data<std::uint8_t>(),
                   [](std::uint8_t constant) { return !constant; });
    return seen;
}

}  // namespace tissuewarp::registration::detail
