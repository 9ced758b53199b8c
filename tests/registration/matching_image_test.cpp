/// What block matching makes of an image, against plain definitions.
#include "registration/matching/descriptors/matching_image.hpp"
#include "registration/matching/consistency/local_affine.hpp"
#include "registration/matching/points/field_of_view.hpp"

#include "tests/registration/textured_phantom.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace tissuewarp::registration::detail {
namespace {

using namespace test;
using imaging::Volume;

Volume everything(const imaging::Geometry& grid) {
    Volume seen(grid, CV_8UC1);
    seen.voxels.setTo(1);
    return seen;
}

/// Gaussian-weighted squared difference of the patches about two voxels.
double plain_patch_distance(const Volume& image, const Voxel& p, const Voxel& q) {
    double sum = 0, weights = 0;
    for (int k = -4; k <= 4; ++k)
        for (int j = -4; j <= 4; ++j)
            for (int i = -4; i <= 4; ++i) {
                const auto value = [&](const Voxel& v) {
                    return double(image.data<float>()[image.offset(v[0] + i, v[1] + j, v[2] + k)]);
                };
                const double weight = std::exp(-0.5 * (i * i + j * j + k * k));
                sum += weight * std::pow(value(p) - value(q), 2);
                weights += weight;
            }
    return sum / weights;
}

/// exp(−(D − min D)/V) of the twelve pairs of neighbours that are not opposite, in any order.
std::vector<double> plain_descriptor(const Volume& image, const Voxel& at) {
    std::vector<Voxel> neighbours;
    for (std::size_t a = 0; a < 3; ++a)
        for (const int sign : {-2, 2}) {
            neighbours.push_back(at);
            neighbours.back()[a] += sign;
        }
    std::vector<double> result;
    for (std::size_t p = 0; p < 6; ++p)
        for (std::size_t q = p + 1; q < 6; ++q)
            if (p / 2 != q / 2) result.push_back(plain_patch_distance(image, neighbours[p], neighbours[q]));
    double mean = 0;
    for (const double d : result) mean += d / 12;
    const double least = *std::min_element(result.begin(), result.end());
    for (double& d : result) d = std::exp(-(d - least) / mean);
    return result;
}

// A wrong shift, pair or weight changes values by tenths. A bound of 1.01 of 255: half a step of rounding and of the
// window, cut off here in a cube.
TEST(SelfSimilarity, IsItsPlainDefinition) {
    const auto grid = plain_grid({40, 41, 39});
    const Volume image = sampled(grid, Texture(), 0.2, 5);
    const SearchRegion region(grid);
    const Descriptors fast = self_similarity_context(GridSamples(image, everything(grid), grid, region), grid, region);
    for (int n = 0; n < 60; ++n) {
        const Voxel at{8 + (7 * n) % 24, 8 + (11 * n) % 25, 8 + (5 * n) % 23};
        std::vector<double> expected = plain_descriptor(image, at), found;
        const auto offset = static_cast<std::size_t>(image.offset(at[0], at[1], at[2]));
        EXPECT_EQ(fast.seen[offset], 1);
        for (std::size_t c = 0; c < 12; ++c) found.push_back(fast.channels[12 * offset + c]);
        std::sort(expected.begin(), expected.end());
        std::sort(found.begin(), found.end());
        for (std::size_t c = 0; c < 12; ++c) EXPECT_NEAR(found[c], 255 * expected[c], 1.01) << n << " " << c;
    }
}

// Sorted channels would hide one that trades places with another from voxel to voxel or with the shape of the region.
TEST(SelfSimilarity, IsTheSameInEveryRegion) {
    const auto grid = plain_grid({50, 90, 70});
    const Volume image = sampled(grid, Texture(), 0.2, 5), seen = everything(grid);
    Eigen::Matrix3Xd points(3, 2);
    points << 20, 30, 33, 60, 31, 40;
    const SearchRegion all(grid), part(grid, points, 6);
    const MatchingImage whole = matching_image(image, seen, grid, all), some = matching_image(image, seen, grid, part);
    int compared = 0;
    for_each_voxel(image, [&](const Eigen::Vector3d& index, std::int64_t offset) {
        const auto n = static_cast<std::size_t>(offset);
        if (!some.seen[n]) return;
        ++compared;
        for (std::size_t c = 0; c < 12; ++c)
            ASSERT_NEAR(some.descriptors[12 * n + c], whole.descriptors[12 * n + c], 1) << index.transpose();
    });
    EXPECT_GT(compared, 2 * 13 * 13 * 13);
    EXPECT_LT(compared, grid.voxel_count() * 3 / 4);
    for (Eigen::Index p = 0; p < 2; ++p)
        for (int n = 0; n < 13 * 13 * 13; ++n) {
            const Eigen::Vector3d v = points.col(p) + Eigen::Vector3d(n % 13 - 6, n / 13 % 13 - 6, n / 169 - 6);
            EXPECT_EQ(some.seen[static_cast<std::size_t>(image.offset(int(v[0]), int(v[1]), int(v[2])))], 1);
        }
}

// Descriptors that read beyond what is seen, and voxels marked unseen for nothing.
TEST(SelfSimilarity, IsSeenThreeVoxelsFromWhatIsNot) {
    const auto grid = plain_grid({40, 40, 40});
    const Volume image = sampled(grid, Texture(), 0.2, 5);
    Volume seen = everything(grid);
    seen.data<std::uint8_t>()[seen.offset(17, 20, 35)] = 0;
    const MatchingImage result = matching_image(image, seen, grid, SearchRegion(grid));
    for_each_voxel(image, [&](const Eigen::Vector3d& index, std::int64_t offset) {
        const bool near_hole = (index - Eigen::Vector3d(17, 20, 35)).cwiseAbs().maxCoeff() <= 3;
        const bool near_border = std::min(index.minCoeff(), 39 - index.maxCoeff()) < 3;
        EXPECT_EQ(result.seen[static_cast<std::size_t>(offset)], !near_hole && !near_border) << index.transpose();
    });
}

// A hole of one value is padding; real tissue with noise is not.
TEST(SeenRegion, LeavesOutPaddingAlone) {
    const auto grid = plain_grid({20, 20, 20});
    Volume image = sampled(grid, Texture(), 0.01);
    for_each_voxel(image, [&](const Eigen::Vector3d& index, std::int64_t offset) {
        if (index[0] >= 12) image.data<float>()[offset] = 0;
    });
    const Volume seen = seen_region(image);
    for_each_voxel(seen, [&](const Eigen::Vector3d& index, std::int64_t offset) {
        EXPECT_EQ(seen.data<std::uint8_t>()[offset] != 0, index[0] < 12) << index.transpose();
    });
}

/// All voxels of the cube of ± 1 about one, borders replicated.
template <class Test>
bool all_about(const Volume& image, int i, int j, int k, const Test& test) {
    const auto& size = image.geometry.size;
    for (int n = 0; n < 27; ++n)
        if (!test(image.offset(std::clamp(i + n % 3 - 1, 0, size[0] - 1), std::clamp(j + n / 3 % 3 - 1, 0, size[1] - 1),
                               std::clamp(k + n / 9 - 1, 0, size[2] - 1))))
            return false;
    return true;
}

TEST(SeenRegion, IsItsPlainDefinition) {
    const auto grid = plain_grid({17, 13, 11});
    Volume image(grid, CV_32FC1);
    for_each_voxel(image, [&](const Eigen::Vector3d& index, std::int64_t offset) {
        const double wave = std::sin(index[0] / 2) + std::sin(index[1] / 2.5) + std::sin(index[2] / 3);
        image.data<float>()[offset] = static_cast<float>(std::max(0.0, std::round(4 * wave) / 4));  // plateaus
    });
    const float* value = image.data<float>();
    Volume constant(grid, CV_8UC1);
    const Volume seen = seen_region(image);
    int unseen = 0;
    const auto each = [&](const auto& visit) {
        for (int k = 0; k < 11; ++k)
            for (int j = 0; j < 13; ++j)
                for (int i = 0; i < 17; ++i) visit(i, j, k, image.offset(i, j, k));
    };
    each([&](int i, int j, int k, std::int64_t n) {
        constant.data<std::uint8_t>()[n] =
            all_about(image, i, j, k, [&](std::int64_t m) { return value[m] == value[n]; });
    });
    each([&](int i, int j, int k, std::int64_t n) {
        const bool expected =
            all_about(image, i, j, k, [&](std::int64_t m) { return constant.data<std::uint8_t>()[m] == 0; });
        EXPECT_EQ(seen.data<std::uint8_t>()[n] != 0, expected) << i << ' ' << j << ' ' << k;
        unseen += expected ? 0 : 1;
    });
    EXPECT_GT(unseen, 100);
    EXPECT_LT(unseen, 17 * 13 * 11 - 100);
}

// A convex chain that turns the wrong way leaves out what spans the hull.
TEST(FieldOfView, HoldsAllThatIsShownAndEndsThereAlongTheAxes) {
    cv::RNG random(9);
    imaging::Geometry grid;
    grid.size = {23, 19, 7};
    grid.spacing = {1, 1.5, 2};
    Volume seen(grid, CV_8UC1);
    for (int n = 0; n < 60; ++n)
        seen.data<std::uint8_t>()[seen.offset(random.uniform(3, 20), random.uniform(2, 17), random.uniform(1, 6))] = 1;
    const FieldOfView view(seen);
    Eigen::Vector3d lower = Eigen::Vector3d::Constant(1e9), upper = -lower;
    for (int k = 0; k < 7; ++k)
        for (int j = 0; j < 19; ++j)
            for (int i = 0; i < 23; ++i) {
                if (!seen.data<std::uint8_t>()[seen.offset(i, j, k)]) continue;
                const Eigen::Vector3d point = grid.point(Eigen::Vector3d(i, j, k));
                EXPECT_LE(view.distance(point), 1e-9);
                lower = lower.cwiseMin(point);
                upper = upper.cwiseMax(point);
            }
    for (int axis = 0; axis < 3; ++axis) {
        Eigen::Vector3d beyond = 0.5 * (lower + upper);
        beyond[axis] = upper[axis] + 100;
        EXPECT_NEAR(view.distance(beyond), 100, 1e-9);
        beyond[axis] = lower[axis] - 100;
        EXPECT_NEAR(view.distance(beyond), 100, 1e-9);
    }
}

// A tree that prunes too early, or breaks ties by its own order.
TEST(NearestNeighbours, AreThoseOfAFullSearch) {
    cv::RNG random(3);
    Eigen::Matrix3Xd points(3, 500);
    for (Eigen::Index n = 0; n < points.size(); ++n) points(n) = random.uniform(0, 12);  // whole numbers: many ties
    for (const int step : {1, 3})
        for (const int count : {0, 1, 24, 600}) {
            std::vector<int> among;
            for (int n = 0; n < 500; n += step) among.push_back(n);
            std::vector<int> all_points(500);
            std::iota(all_points.begin(), all_points.end(), 0);
            const auto found = nearest_neighbours(points, all_points, among, count);
            EXPECT_EQ(nearest_neighbours(points, {7, 3}, among, count), (std::vector{found[7], found[3]}));
            for (Eigen::Index p = 0; p < points.cols(); ++p) {
                std::vector<std::pair<double, int>> all;
                for (const int n : among)
                    if (n != p) all.emplace_back((points.col(n) - points.col(p)).squaredNorm(), n);
                std::sort(all.begin(), all.end());
                all.resize(std::min<std::size_t>(all.size(), static_cast<std::size_t>(count)));
                std::vector<int> expected;
                for (const auto& [distance, n] : all) expected.push_back(n);
                EXPECT_EQ(found[static_cast<std::size_t>(p)], expected) << p;
            }
            if (step == 1) {
                EXPECT_EQ(nearest_neighbours(points, count), found);
            }
        }
}

}  // namespace
}  // namespace tissuewarp::registration::detail
