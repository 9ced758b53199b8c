#include "registration/detail/block_window.hpp"

#include <algorithm>
#include <cstring>

namespace tissuewarp::registration::detail {

BlockWindow::BlockWindow(const MatchingImage& image, const Voxel& lower, int side) : side_(side) {
    const auto row = static_cast<std::size_t>(side * descriptor_channels + row_padding),
               count = std::size_t(side) * side;
    value_.resize(row * count);
    mask_.resize(row * count);
    std::size_t target = 0;
    for (int k = 0; k < side; ++k)
        for (int j = 0; j < side; ++j, target += row) copy_row(image, {lower[0], lower[1] + j, lower[2] + k}, target);
}

void BlockWindow::copy_row(const MatchingImage& image, const Voxel& lower, std::size_t target) {
    const auto& size = image.grid.size;
    const int first = std::max(lower[0], 0), last = std::min(lower[0] + side_, size[0]);
    const bool on_grid = lower[1] >= 0 && lower[1] < size[1] && lower[2] >= 0 && lower[2] < size[2] && first < last;
    whole_ = whole_ && on_grid && last - first == side_;
    if (!on_grid) return;
    const auto source = static_cast<std::size_t>(image.offset({first, lower[1], lower[2]}));
    target += static_cast<std::size_t>(first - lower[0]) * descriptor_channels;
    std::memcpy(&value_[target], &image.descriptors[source * descriptor_channels],
                static_cast<std::size_t>(last - first) * descriptor_channels);
    for (int i = 0; i < last - first; ++i, target += descriptor_channels)
        if (image.seen[source + static_cast<std::size_t>(i)])
            std::memset(&mask_[target], 255, descriptor_channels);
        else
            whole_ = false;
}

ByteRows BlockWindow::rows(int j, int k) const {
    const std::ptrdiff_t row = side_ * descriptor_channels + row_padding, slice = row * side_;
    const std::ptrdiff_t start = j * row + k * slice;
    return {value_.data() + start, mask_.data() + start, row, slice};
}

}  // namespace tissuewarp::registration::detail
