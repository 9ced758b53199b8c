// Compiled for every instruction set, chosen at run time. Sums of integers: the same on all of them.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "registration/detail/squared_differences.cpp"
// foreach_target.h must come before highway.h.
// clang-format off
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// clang-format on

#include "registration/detail/squared_differences.hpp"

HWY_BEFORE_NAMESPACE();
namespace tissuewarp::registration::detail {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Tag16 = hn::ScalableTag<std::int16_t>;
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

/// Four shifts at a time share the loads of the block.
struct WholeSums {
    Squares s0, s1, s2, s3;

    HWY_INLINE WholeSums() : s0(), s1(), s2(), s3() {}
    template <int shifts>
    HWY_INLINE void add(const std::uint8_t* block, const std::uint8_t* window, int step) {
        const Words m = words(hn::LoadU(Tag8(), block));
        s0.add(hn::Sub(m, words(hn::LoadU(Tag8(), window))));
        if constexpr (shifts > 1) s1.add(hn::Sub(m, words(hn::LoadU(Tag8(), window + step))));
        if constexpr (shifts > 2) s2.add(hn::Sub(m, words(hn::LoadU(Tag8(), window + 2 * step))));
        if constexpr (shifts > 3) s3.add(hn::Sub(m, words(hn::LoadU(Tag8(), window + 3 * step))));
    }
    /// The end of a row: what lies behind it is 0 in the block and masked in the window.
    template <int shifts>
    HWY_INLINE void add_end(const std::uint8_t* block, const std::uint8_t* mask, const std::uint8_t* window, int step) {
        const Words m = words(hn::LoadU(Tag8(), block));
        const Bytes in_row = hn::LoadU(Tag8(), mask);
        const auto masked = [&](const std::uint8_t* at) { return words(hn::And(in_row, hn::LoadU(Tag8(), at))); };
        s0.add(hn::Sub(m, masked(window)));
        if constexpr (shifts > 1) s1.add(hn::Sub(m, masked(window + step)));
        if constexpr (shifts > 2) s2.add(hn::Sub(m, masked(window + 2 * step)));
        if constexpr (shifts > 3) s3.add(hn::Sub(m, masked(window + 3 * step)));
    }
};

template <int shifts>
void whole_shifts(const ByteRows& block, const ByteRows& window, const RowComparison& c, std::int64_t* differences) {
    const int lanes = static_cast<int>(hn::Lanes(Tag8()));
    WholeSums sums;
    for (int k = 0; k < c.count; k += c.stride)
        for (int j = 0; j < c.count; j += c.stride) {
            const std::ptrdiff_t m = k * block.slice + j * block.row;
            const std::uint8_t* row = window.value + k * window.slice + j * window.row;
            int x = 0;
            for (; x + lanes <= c.bytes; x += lanes) sums.add<shifts>(block.value + m + x, row + x, c.step);
            if (x < c.bytes) sums.add_end<shifts>(block.value + m + x, block.mask + m + x, row + x, c.step);
        }
    differences[0] = sums.s0.total();
    if constexpr (shifts > 1) differences[1] = sums.s1.total();
    if constexpr (shifts > 2) differences[2] = sums.s2.total();
    if constexpr (shifts > 3) differences[3] = sums.s3.total();
}

void whole_rows(const ByteRows& block, const ByteRows& window, const RowComparison& comparison,
                std::int64_t* differences) {
    ByteRows at = window;
    for (int s = 0; s < comparison.shifts; s += 4, at.value += 4 * comparison.step) {
        const int left = comparison.shifts - s;
        if (left >= 4)
            whole_shifts<4>(block, at, comparison, differences + s);
        else if (left == 3)
            whole_shifts<3>(block, at, comparison, differences + s);
        else if (left == 2)
            whole_shifts<2>(block, at, comparison, differences + s);
        else
            whole_shifts<1>(block, at, comparison, differences + s);
    }
}

void masked_shift(const ByteRows& block, const ByteRows& window, const RowComparison& c, std::int64_t* difference,
                  std::int64_t* count) {
    const int lanes = static_cast<int>(hn::Lanes(Tag8()));
    Squares squares, both_seen;
    for (int k = 0; k < c.count; k += c.stride)
        for (int j = 0; j < c.count; j += c.stride) {
            const std::ptrdiff_t m = k * block.slice + j * block.row, f = k * window.slice + j * window.row;
            for (int x = 0; x < c.bytes; x += lanes) {
                const Bytes both =
                    hn::And(hn::LoadU(Tag8(), block.mask + m + x), hn::LoadU(Tag8(), window.mask + f + x));
                const Bytes a = hn::And(both, hn::LoadU(Tag8(), block.value + m + x));
                const Bytes b = hn::And(both, hn::LoadU(Tag8(), window.value + f + x));
                squares.add(hn::Sub(words(a), words(b)));
                both_seen.add(words(both));
            }
        }
    *difference = squares.total();
    *count = both_seen.total();
}

void masked_rows(const ByteRows& block, const ByteRows& window, const RowComparison& comparison,
                 std::int64_t* differences, std::int64_t* counts) {
    ByteRows at = window;
    for (int s = 0; s < comparison.shifts; ++s, at.value += comparison.step, at.mask += comparison.step)
        masked_shift(block, at, comparison, differences + s, counts + s);
}

}  // namespace HWY_NAMESPACE
}  // namespace tissuewarp::registration::detail
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tissuewarp::registration::detail {

HWY_EXPORT(whole_rows);
HWY_EXPORT(masked_rows);

void whole_squared_differences(const ByteRows& block, const ByteRows& window, const RowComparison& comparison,
                               std::int64_t* differences) {
    HWY_DYNAMIC_DISPATCH(whole_rows)(block, window, comparison, differences);
}

void masked_squared_differences(const ByteRows& block, const ByteRows& window, const RowComparison& comparison,
                                std::int64_t* differences, std::int64_t* counts) {
    HWY_DYNAMIC_DISPATCH(masked_rows)(block, window, comparison, differences, counts);
}

}  // namespace tissuewarp::registration::detail
#endif
