// Compiled for every instruction set, chosen at run time. Sums of integers: the same on all of them.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "registration/detail/descriptor_products.cpp"
// foreach_target.h must come before highway.h.
// clang-format off
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// clang-format on

#include "registration/detail/descriptor_products.hpp"

#include "registration/detail/self_similarity.hpp"

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
    ProductSum ii, jj, kk, ij, ik, jk, ri, rj, rk, structure, squares;
    for (std::size_t channel = 0; channel < descriptor_channels; channel += hn::Lanes(Tag16())) {
        const Channels channels = hn::FirstN(Tag16(), descriptor_channels - channel);
        for (const std::ptrdiff_t voxel : voxels) {
            const std::ptrdiff_t at = descriptor_channels * voxel + static_cast<std::ptrdiff_t>(channel);
            const Differences a(first + at, bytes, channels), b(second + at, bytes, channels);
            const Words residual = hn::IfThenElseZero(channels, hn::Sub(load(first + at), load(second + at)));
            ii.add(a.i, b.i);
            jj.add(a.j, b.j);
            kk.add(a.k, b.k);
            ij.add(a.i, b.j);
            ij.add(a.j, b.i);
            ik.add(a.i, b.k);
            ik.add(a.k, b.i);
            jk.add(a.j, b.k);
            jk.add(a.k, b.j);
            ri.add(hn::Add(a.i, b.i), residual);
            rj.add(hn::Add(a.j, b.j), residual);
            rk.add(hn::Add(a.k, b.k), residual);
            structure.add(a.i, a.i);
            structure.add(a.j, a.j);
            structure.add(a.k, a.k);
            structure.add(b.i, b.i);
            structure.add(b.j, b.j);
            structure.add(b.k, b.k);
            squares.add(residual, residual);
        }
    }
    return {{ii.total(), jj.total(), kk.total()},
            {ij.total(), ik.total(), jk.total()},
            {ri.total(), rj.total(), rk.total()},
            structure.total(),
            squares.total()};
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
