#include "registration/detail/matching_grid.hpp"
#include "registration/detail/matching_image.hpp"

#include <tbb/parallel_for.h>

namespace tissuewarp::registration::detail {

using imaging::Volume;

namespace {

/// to(n) = combine(n, before, after) for every voxel n and its neighbours along an axis, borders replicated.
template <class Combine>
void along_axis(const Volume& image, std::size_t axis, std::uint8_t* to, const Combine& combine) {
    const auto& size = image.geometry.size;
    const std::array<std::ptrdiff_t, 3> strides{1, size[0], std::ptrdiff_t{size[0]} * size[1]};
    const std::ptrdiff_t stride = strides[axis];
    tbb::parallel_for(0, size[2], [&](int k) {
        for (int j = 0; j < size[1]; ++j) {
            const std::ptrdiff_t row = image.offset(0, j, k);
            const int at = axis == 1 ? j : k;
            const auto run = [&](int first, int last, std::ptrdiff_t before, std::ptrdiff_t after) {
                for (std::ptrdiff_t n = row + first; n < row + last; ++n)
                    to[n] = static_cast<std::uint8_t>(combine(n, n + before, n + after));
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
}

}  // namespace

Volume seen_region(const Volume& image) {
    const float* value = image.data<float>();
    Volume seen(image.geometry, CV_8UC1);
    std::vector<std::uint8_t> first(static_cast<std::size_t>(image.geometry.voxel_count())), second(first.size());
    // A cube is of one value when its three slices are, and their centres agree.
    const auto differ = [&](std::size_t axis, const std::uint8_t* from, std::uint8_t* to) {
        along_axis(image, axis, to, [=](std::ptrdiff_t n, std::ptrdiff_t before, std::ptrdiff_t after) {
            return from[before] | from[n] | from[after] | (value[before] != value[n]) | (value[after] != value[n]);
        });
    };
    const auto all = [&](std::size_t axis, const std::uint8_t* from, std::uint8_t* to) {
        along_axis(image, axis, to, [=](std::ptrdiff_t n, std::ptrdiff_t before, std::ptrdiff_t after) {
            return from[before] & from[n] & from[after];
        });
    };
    differ(0, first.data(), second.data());
    differ(1, second.data(), first.data());
    differ(2, first.data(), second.data());
    all(0, second.data(), first.data());
    all(1, first.data(), second.data());
    all(2, second.data(), seen.data<std::uint8_t>());
    return seen;
}

SeenImage::SeenImage(const Volume& given) {
    image = given.as(CV_32F);  // which may overflow
    require_finite(image, "block matching: the fixed image");
    seen = seen_region(image);
}

}  // namespace tissuewarp::registration::detail
