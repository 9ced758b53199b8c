// Compiled for every instruction set, chosen at run time. Sums of integers: the same on all of them.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "registration/matching/dense/descriptor_products.cpp"
// foreach_target.h must come before highway.h.
// clang-format off
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// clang-format on

#include "registration/matching/dense/descriptor_products.hpp"

#include "registration/matching/descriptors/self_similarity.hpp"

HWY_BEFORE_NAMESPACE();
namespace tissuewarp::registration::detail {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Tag16 = hn::CappedTag<std::int16_t, 16>;
using Tag8 = hn::Rebind<std::uint8_t, Tag16>;
using Tag32 = hn::Repartition<std::int32_t, Tag16>;
using Words = hn::Vec<Tag16>;
using Lanes32 = hn::Vec<Tag32>;
using Channels = hn::Mask<Tag16>;

/// Σ x y of words; two halves where the instruction set keeps them apart.
struct ProductSum {
    Lanes32 even, odd;

    // Constructors are written out: implicit ones are not compiled for the instruction set.
    HWY_INLINE ProductSum() : even(hn::Zero(Tag32())), odd(hn::Zero(Tag32())) {}
    HWY_INLINE void add(Words x, Words y) { even = hn::ReorderWidenMulAccumulate(Tag32(), x, y, even, odd); }
    [[nodiscard]] std::int32_t total() const {
        HWY_ALIGN std::int32_t lanes[hn::MaxLanes(Tag32())];
        hn::Store(hn::Add(even, odd), Tag32(), lanes);
        std::int32_t sum = 0;
        for (std::size_t n = 0; n < hn::Lanes(Tag32()); ++n) sum += lanes[n];
        return sum;
    }
};

HWY_INLINE Words load(const std::uint8_t* at) {
    return hn::PromoteTo(Tag16(), hn::LoadU(Tag8(), at));
}

/// Some channels of a voxel's descriptor and their differences, 0 in the other lanes.
struct Differences {
    Words i, j, k;

    HWY_INLINE Differences(const std::uint8_t* at, const std::array<std::ptrdiff_t, 3>& bytes, Channels channels)
        : i(along(at, bytes[0], channels)), j(along(at, bytes[1], channels)), k(along(at, bytes[2], channels)) {}

    static HWY_INLINE Words along(const std::uint8_t* at, std::ptrdiff_t bytes, Channels channels) {
        return hn::IfThenElseZero(channels, hn::Sub(load(at + bytes), load(at - bytes)));
    }
};

DescriptorProducts products(const std::uint8_t* first, const std::uint8_t* second,
                            const std::array<std::ptrdiff_t, 3>& stride, std::span<const std::ptrdiff_t> voxels) {
    const std::array<std::ptrdiff_t, 3> bytes{descriptor_channels * stride[0], descriptor_channels * stride[1],
                                              descriptor_channels * stride[2]};
    const Words one = hn::Set(Tag16(), 1);
    ProductSum ii, jj, kk, ij, ik, jk, ri, rj, rk, structure, squares;
    ProductSum slope_i, slope_j, slope_k, end_i, end_j, end_k, first_squares, first_sum, first_residual, residual_sum;
    for (std::size_t channel = 0; channel < descriptor_channels; channel += hn::Lanes(Tag16())) {
        const Channels channels = hn::FirstN(Tag16(), descriptor_channels - channel);
        for (const std::ptrdiff_t voxel : voxels) {
            const std::ptrdiff_t at = descriptor_channels * voxel + static_cast<std::ptrdiff_t>(channel);
            const Differences a(first + at, bytes, channels), b(second + at, bytes, channels);
            const Words value = hn::IfThenElseZero(channels, load(first + at)),
                        residual = hn::Sub(value, hn::IfThenElseZero(channels, load(second + at))),
                        sum_i = hn::Add(a.i, b.i), sum_j = hn::Add(a.j, b.j), sum_k = hn::Add(a.k, b.k);
            ii.add(a.i, b.i);
            jj.add(a.j, b.j);
            kk.add(a.k, b.k);
            ij.add(a.i, b.j);
            ij.add(a.j, b.i);
            ik.add(a.i, b.k);
            ik.add(a.k, b.i);
            jk.add(a.j, b.k);
            jk.add(a.k, b.j);
            ri.add(sum_i, residual);
            rj.add(sum_j, residual);
            rk.add(sum_k, residual);
            structure.add(a.i, a.i);
            structure.add(a.j, a.j);
            structure.add(a.k, a.k);
            structure.add(b.i, b.i);
            structure.add(b.j, b.j);
            structure.add(b.k, b.k);
            squares.add(residual, residual);
            slope_i.add(sum_i, value);
            slope_j.add(sum_j, value);
            slope_k.add(sum_k, value);
            end_i.add(sum_i, one);
            end_j.add(sum_j, one);
            end_k.add(sum_k, one);
            first_squares.add(value, value);
            first_sum.add(value, one);
            first_residual.add(value, residual);
            residual_sum.add(residual, one);
        }
    }
    return {{ii.total(), jj.total(), kk.total()},
            {ij.total(), ik.total(), jk.total()},
            {ri.total(), rj.total(), rk.total()},
            structure.total(),
            squares.total(),
            {slope_i.total(), slope_j.total(), slope_k.total()},
            {end_i.total(), end_j.total(), end_k.total()},
            first_squares.total(),
            first_sum.total(),
            first_residual.total(),
            residual_sum.total()};
}

}  // namespace HWY_NAMESPACE
}  // namespace tissuewarp::registration::detail
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tissuewarp::registration::detail {

HWY_EXPORT(products);

DescriptorProducts descriptor_products(const std::uint8_t* first, const std::uint8_t* second,
                                       const std::array<std::ptrdiff_t, 3>& stride,
                                       std::span<const std::ptrdiff_t> voxels) {
    return HWY_DYNAMIC_DISPATCH(products)(first, second, stride, voxels);
}

}  // namespace tissuewarp::registration::detail
#endif
