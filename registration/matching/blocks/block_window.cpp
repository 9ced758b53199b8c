#include "registration/matching/blocks/block_window.hpp"

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <cstring>

namespace tissuewarp::registration::detail {

void BlockWindow::cut(const MatchingImage& image, const Voxel& lower, int side) {
    side_ = side;
    row_bytes_ = side * descriptor_channels + row_padding;
    kind_.assign(static_cast<std::size_t>(side) * static_cast<std::size_t>(side), RowKind::Nothing);
    seen_.assign(kind_.size(), 0);
    const std::size_t bytes = kind_.size() * static_cast<std::size_t>(row_bytes_);
    if (bytes > bytes_) {
        bytes_ = bytes;
        value_ = std::make_unique_for_overwrite<std::uint8_t[]>(bytes);
        mask_ = std::make_unique_for_overwrite<std::uint8_t[]>(bytes);
    }
    std::size_t row = 0;
    for (int k = 0; k < side; ++k)
        for (int j = 0; j < side; ++j, ++row) copy_row(image, {lower[0], lower[1] + j, lower[2] + k}, row);
}

void BlockWindow::copy_row(const MatchingImage& image, const Voxel& lower, std::size_t row) {
    const auto& size = image.grid.size;
    const int first = std::max(lower[0], 0), last = std::min(lower[0] + side_, size[0]);
    if (lower[1] < 0 || lower[1] >= size[1] || lower[2] < 0 || lower[2] >= size[2] || first >= last) return;
    const auto source = static_cast<std::size_t>(image.offset({first, lower[1], lower[2]}));
    const auto skipped = static_cast<std::size_t>(first - lower[0]), voxels = static_cast<std::size_t>(last - first);
    std::uint64_t bits = 0;
    for (std::size_t i = 0; i < voxels; ++i) bits |= std::uint64_t{image.seen[source + i]} << (skipped + i);
    if (bits == 0) return;
    const std::size_t target = row * static_cast<std::size_t>(row_bytes_);
    std::memcpy(&value_[target + skipped * descriptor_channels], &image.descriptors[source * descriptor_channels],
                voxels * descriptor_channels);
    seen_[row] = bits;
    kind_[row] = std::popcount(bits) == side_ ? RowKind::Whole : RowKind::Part;
    if (kind_[row] == RowKind::Whole) return;
    std::memset(&mask_[target], 0, static_cast<std::size_t>(row_bytes_));
    for (std::size_t i = 0; i < voxels; ++i)
        if (image.seen[source + i])
            std::memset(&mask_[target + (skipped + i) * descriptor_channels], 255, descriptor_channels);
}

VoxelRows BlockWindow::rows(const Voxel& from) const {
    const std::ptrdiff_t row = from[1] + std::ptrdiff_t{side_} * from[2];
    const std::ptrdiff_t start = row * row_bytes_ + std::ptrdiff_t{descriptor_channels} * from[0];
    return {
        value_.get() + start, mask_.get() + start, kind_.data() + row, seen_.data() + row, from[0], row_bytes_, side_};
}

void Surroundings::cover(const Voxel& centre, int reach) {
    bool within = true;
    for (std::size_t a = 0; a < 3; ++a) within = within && std::abs(centre[a] - centre_[a]) + reach <= reach_;
    if (within && cut_) return;
    if (!within) {
        centre_ = centre;
        reach_ = reach;
    }
    window_.cut(image_, lower(), 2 * reach_ + 1);
    cut_ = true;
}

VoxelRows Surroundings::rows(const Voxel& from) const {
    const Voxel first = lower();
    return window_.rows({from[0] - first[0], from[1] - first[1], from[2] - first[2]});
}

}  // namespace tissuewarp::registration::detail
