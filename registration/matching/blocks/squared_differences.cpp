// Compiled for every instruction set, chosen at run time. Sums of integers: the same on all of them.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "registration/matching/blocks/squared_differences.cpp"
// foreach_target.h must come before highway.h.
// clang-format off
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// clang-format on

#include "registration/matching/blocks/squared_differences.hpp"

#include <array>

HWY_BEFORE_NAMESPACE();
namespace tissuewarp::registration::detail {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Tag16 = hn::CappedTag<std::int16_t, row_padding>;
using Tag8 = hn::Rebind<std::uint8_t, Tag16>;
using Tag32 = hn::Repartition<std::int32_t, Tag16>;
using Bytes = hn::Vec<Tag8>;
using Words = hn::Vec<Tag16>;
using Sums = hn::Vec<Tag32>;

/// Σ x² of words; two halves where the instruction set keeps them apart.
struct Squares {
    Sums even, odd;

    // Constructors are written out: implicit ones are not compiled for the instruction set.
    HWY_INLINE Squares() : even(hn::Zero(Tag32())), odd(hn::Zero(Tag32())) {}
    HWY_INLINE void add(Words x) { even = hn::ReorderWidenMulAccumulate(Tag32(), x, x, even, odd); }
    [[nodiscard]] std::int64_t total() const {
        HWY_ALIGN std::int32_t lanes[hn::MaxLanes(Tag32())];
        hn::Store(hn::Add(even, odd), Tag32(), lanes);
        std::int64_t sum = 0;
        for (std::size_t n = 0; n < hn::Lanes(Tag32()); ++n) sum += lanes[n];
        return sum;
    }
};

HWY_INLINE Words words(Bytes bytes) {
    return hn::PromoteTo(Tag16(), bytes);
}

HWY_INLINE Bytes load(const std::uint8_t* at) {
    return hn::LoadU(Tag8(), at);
}

/// 255 in the first `count` lanes.
HWY_INLINE Bytes first_lanes(int count) {
    constexpr int widest = row_padding;
    static constexpr auto mask = [] {
        std::array<std::uint8_t, 2 * std::size_t{widest}> bytes{};
        for (std::size_t n = 0; n < widest; ++n) bytes[n] = 255;
        return bytes;
    }();
    return load(mask.data() + widest - count);
}

/// Up to four shifts at a time share the loads of the block.
template <int shifts>
class ShiftSums {
public:
    HWY_INLINE ShiftSums() : d0(), d1(), d2(), d3() {}

    HWY_INLINE void add_whole(const std::uint8_t* block, const std::uint8_t* window, int bytes, int step) {
        const int lanes = static_cast<int>(hn::Lanes(Tag8()));
        int x = 0;
        for (; x + lanes <= bytes; x += lanes) {
            const Words m = words(load(block + x));
            const std::uint8_t* w = window + x;
            d0.add(hn::Sub(m, words(load(w))));
            if constexpr (shifts > 1) d1.add(hn::Sub(m, words(load(w + step))));
            if constexpr (shifts > 2) d2.add(hn::Sub(m, words(load(w + 2 * step))));
            if constexpr (shifts > 3) d3.add(hn::Sub(m, words(load(w + 3 * step))));
        }
        if (x < bytes) {
            const Bytes end = first_lanes(bytes - x);
            const Words m = words(hn::And(end, load(block + x)));
            const std::uint8_t* w = window + x;
            d0.add(hn::Sub(m, words(hn::And(end, load(w)))));
            if constexpr (shifts > 1) d1.add(hn::Sub(m, words(hn::And(end, load(w + step)))));
            if constexpr (shifts > 2) d2.add(hn::Sub(m, words(hn::And(end, load(w + 2 * step)))));
            if constexpr (shifts > 3) d3.add(hn::Sub(m, words(hn::And(end, load(w + 3 * step)))));
        }
    }

    /// What a row of the block shows is given by `block_mask`, where it is not null, and likewise of the window.
    HWY_INLINE void add_part(const std::uint8_t* block, const std::uint8_t* block_mask, const std::uint8_t* window,
                             const std::uint8_t* window_mask, int bytes, int step) {
        const int lanes = static_cast<int>(hn::Lanes(Tag8()));
        for (int x = 0; x < bytes; x += lanes) {
            Bytes shown = first_lanes(bytes - x < lanes ? bytes - x : lanes);
            if (block_mask) shown = hn::And(shown, load(block_mask + x));
            const Bytes m = load(block + x);
            const auto mask = [&](int s) { return window_mask ? window_mask + x + s * step : nullptr; };
            const std::uint8_t* w = window + x;
            add_masked(m, shown, w, mask(0), d0);
            if constexpr (shifts > 1) add_masked(m, shown, w + step, mask(1), d1);
            if constexpr (shifts > 2) add_masked(m, shown, w + 2 * step, mask(2), d2);
            if constexpr (shifts > 3) add_masked(m, shown, w + 3 * step, mask(3), d3);
        }
    }

    void store(std::int64_t* differences) const {
        differences[0] = d0.total();
        if constexpr (shifts > 1) differences[1] = d1.total();
        if constexpr (shifts > 2) differences[2] = d2.total();
        if constexpr (shifts > 3) differences[3] = d3.total();
    }

private:
    Squares d0, d1, d2, d3;

    HWY_INLINE static void add_masked(Bytes m, Bytes shown, const std::uint8_t* window, const std::uint8_t* mask,
                                      Squares& difference) {
        const Bytes both = mask ? hn::And(shown, load(mask)) : shown;
        difference.add(hn::Sub(words(hn::And(both, m)), words(hn::And(both, load(window)))));
    }
};

template <int shifts>
void compare_shifts(const VoxelRows& block, const VoxelRows& window, const RowComparison& c, std::int64_t* differences,
                    std::int64_t* voxels) {
    ShiftSums<shifts> sums;
    std::int64_t whole = 0;
    for (int s = 0; s < shifts; ++s) voxels[s] = 0;
    const int bytes = c.side * c.voxel_bytes;
    const std::uint64_t one_row = ~std::uint64_t{0} >> (most_row_voxels - c.side);
    for (int k = c.first; k < c.side; k += c.stride)
        for (int j = c.first; j < c.side; j += c.stride) {
            const std::ptrdiff_t b = j + k * block.slice_rows, w = j + k * window.slice_rows;
            const std::uint8_t *from = block.value + b * block.row_bytes, *to = window.value + w * window.row_bytes;
            const RowKind shown = block.kind[b], seen = window.kind[w];
            if (shown == RowKind::Nothing || seen == RowKind::Nothing) continue;
            if (shown == RowKind::Whole && seen == RowKind::Whole) {
                sums.add_whole(from, to, bytes, c.voxel_bytes);
                whole += c.side;
                continue;
            }
            sums.add_part(from, shown == RowKind::Part ? block.mask + b * block.row_bytes : nullptr, to,
                          seen == RowKind::Part ? window.mask + w * window.row_bytes : nullptr, bytes, c.voxel_bytes);
            for (int s = 0; s < shifts; ++s)
                voxels[s] += static_cast<std::int64_t>(
                    hwy::PopCount(one_row & (block.seen[b] >> block.first) & (window.seen[w] >> (window.first + s))));
        }
    sums.store(differences);
    for (int s = 0; s < shifts; ++s) voxels[s] += whole;
}

void compare(const VoxelRows& block, const VoxelRows& window, const RowComparison& comparison,
             std::int64_t* differences, std::int64_t* voxels) {
    VoxelRows at = window;
    for (int s = 0; s < comparison.shifts; s += 4) {
        switch (comparison.shifts - s) {
            case 1:
                compare_shifts<1>(block, at, comparison, differences + s, voxels + s);
                break;
            case 2:
                compare_shifts<2>(block, at, comparison, differences + s, voxels + s);
                break;
            case 3:
                compare_shifts<3>(block, at, comparison, differences + s, voxels + s);
                break;
            default:
                compare_shifts<4>(block, at, comparison, differences + s, voxels + s);
        }
        at.value += 4 * comparison.voxel_bytes;
        at.mask += 4 * comparison.voxel_bytes;
        at.first += 4;
    }
}

}  // namespace HWY_NAMESPACE
}  // namespace tissuewarp::registration::detail
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tissuewarp::registration::detail {

HWY_EXPORT(compare);

void squared_differences(const VoxelRows& block, const VoxelRows& window, const RowComparison& comparison,
                         std::int64_t* differences, std::int64_t* voxels) {
    HWY_DYNAMIC_DISPATCH(compare)(block, window, comparison, differences, voxels);
}

}  // namespace tissuewarp::registration::detail
#endif
