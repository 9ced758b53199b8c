/// Products of descriptors in vectors against plain loops.
#include "registration/matching/dense/descriptor_products.hpp"

#include "registration/matching/descriptors/self_similarity.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <random>
#include <vector>

namespace tissuewarp::registration::detail {
namespace {

constexpr std::array<std::ptrdiff_t, 3> stride{1, 11, 99};
constexpr std::ptrdiff_t voxel_count = 11 * 9 * 9;
using Bytes = std::vector<std::uint8_t>;

Bytes descriptors(const std::function<int()>& level) {
    Bytes bytes(descriptor_channels * voxel_count);
    for (auto& byte : bytes) byte = static_cast<std::uint8_t>(level());
    return bytes;
}

/// Every voxel with neighbours on all sides, up to the number that a call may have.
std::vector<std::ptrdiff_t> inner_voxels() {
    std::vector<std::ptrdiff_t> voxels;
    for (int k = 1; k < 8; ++k)
        for (int j = 1; j < 8; ++j)
            for (int i = 1; i < 10; ++i)
                if (voxels.size() < most_product_voxels) voxels.push_back(i + 11 * j + 99 * k);
    return voxels;
}

/// The definition, in 64 bits.
void expect_definition(const Bytes& first, const Bytes& second, const std::vector<std::ptrdiff_t>& voxels) {
    std::array<std::int64_t, 3> diagonal{}, mixed{}, right{}, slopes{}, ends{};
    std::int64_t structure = 0, squares = 0, first_squares = 0, first_sum = 0, first_residual = 0, residual_sum = 0;
    for (const std::ptrdiff_t voxel : voxels)
        for (int channel = 0; channel < descriptor_channels; ++channel) {
            const auto at = [&](const Bytes& bytes, std::ptrdiff_t n) {
                return std::int64_t{bytes[static_cast<std::size_t>(descriptor_channels * n + channel)]};
            };
            std::array<std::int64_t, 3> a, b;
            for (std::size_t axis = 0; axis < 3; ++axis) {
                a[axis] = at(first, voxel + stride[axis]) - at(first, voxel - stride[axis]);
                b[axis] = at(second, voxel + stride[axis]) - at(second, voxel - stride[axis]);
            }
            const std::int64_t value = at(first, voxel), residual = value - at(second, voxel);
            const std::array<std::array<std::size_t, 2>, 3> pairs{{{0, 1}, {0, 2}, {1, 2}}};
            for (std::size_t axis = 0; axis < 3; ++axis) {
                diagonal[axis] += a[axis] * b[axis];
                mixed[axis] += a[pairs[axis][0]] * b[pairs[axis][1]] + a[pairs[axis][1]] * b[pairs[axis][0]];
                right[axis] += (a[axis] + b[axis]) * residual;
                slopes[axis] += (a[axis] + b[axis]) * value;
                ends[axis] += a[axis] + b[axis];
                structure += a[axis] * a[axis] + b[axis] * b[axis];
            }
            squares += residual * residual;
            first_squares += value * value;
            first_sum += value;
            first_residual += value * residual;
            residual_sum += residual;
        }
    const DescriptorProducts found = descriptor_products(first.data(), second.data(), stride, voxels);
    for (std::size_t axis = 0; axis < 3; ++axis) {
        EXPECT_EQ(found.diagonal[axis], diagonal[axis]) << axis;
        EXPECT_EQ(found.mixed[axis], mixed[axis]) << axis;
        EXPECT_EQ(found.right[axis], right[axis]) << axis;
        EXPECT_EQ(found.slopes[axis], slopes[axis]) << axis;
        EXPECT_EQ(found.ends[axis], ends[axis]) << axis;
    }
    EXPECT_EQ(found.structure, structure);
    EXPECT_EQ(found.squares, squares);
    EXPECT_EQ(found.first_squares, first_squares);
    EXPECT_EQ(found.first, first_sum);
    EXPECT_EQ(found.first_residual, first_residual);
    EXPECT_EQ(found.residual, residual_sum);
}

// Channels of the next voxel that a wide load takes in, swapped axes or words that saturate change integers.
TEST(DescriptorProducts, AreTheirDefinition) {
    std::mt19937 random(7);
    const auto noise = [&] { return static_cast<int>(random() % 256); };
    const Bytes first = descriptors(noise), second = descriptors(noise);
    expect_definition(first, second, inner_voxels());
    expect_definition(first, second, {12 + 99});
    expect_definition(first, second, {});
}

// The largest differences everywhere: a sum that leaves 32 bits turns negative.
TEST(DescriptorProducts, HoldTheLargestSums) {
    Bytes stripes(descriptor_channels * voxel_count);
    for (std::ptrdiff_t n = 0; n < voxel_count; ++n) {
        const bool bright = n / 2 % 2 == 0;  // two voxels away the other
        std::fill_n(stripes.begin() + descriptor_channels * n, descriptor_channels, bright ? 255 : 0);
    }
    Bytes inverted = stripes;
    for (auto& byte : inverted) byte = static_cast<std::uint8_t>(255 - byte);
    expect_definition(stripes, stripes, inner_voxels());
    expect_definition(stripes, inverted, inner_voxels());
}

}  // namespace
}  // namespace tissuewarp::registration::detail
