/// The cost of a block, row by row, against its plain definition; the parabola through its minimum.
#include "registration/detail/block_cost.hpp"
#include "registration/detail/quadratic_fit.hpp"

#include "tests/registration/textured_phantom.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace tissuewarp::registration::detail {
namespace {

using namespace test;

/// The mean squared difference of descriptors by its definition, voxel by voxel.
double plain_cost(const MatchingImage& moving, const MatchingImage& fixed, const Block& block, const Voxel& at) {
    double sum = 0;
    int voxels = 0;
    const auto seen = [](const MatchingImage& image, const Voxel& v) {
        for (std::size_t a = 0; a < 3; ++a)
            if (v[a] < 0 || v[a] >= image.grid.size[a]) return false;
        return image.seen[static_cast<std::size_t>(image.offset(v))] > 0;
    };
    const int r = block.radius;
    for (int k = -r; k <= r; ++k)
        for (int j = -r; j <= r; ++j)
            for (int i = -r; i <= r; ++i) {
                const Voxel m{block.centre[0] + i, block.centre[1] + j, block.centre[2] + k};
                const Voxel f{at[0] + i, at[1] + j, at[2] + k};
                if (!seen(moving, m) || !seen(fixed, f)) continue;
                ++voxels;
                for (std::size_t c = 0; c < 12; ++c) {
                    const double a = moving.descriptors[12 * static_cast<std::size_t>(moving.offset(m)) + c];
                    const double b = fixed.descriptors[12 * static_cast<std::size_t>(fixed.offset(f)) + c];
                    sum += (a - b) * (a - b) / (255.0 * 255.0);
                }
            }
    const double all = std::pow(2 * r + 1, 3);
    return voxels < block.least_share * all ? std::numeric_limits<double>::infinity() : sum / (12.0 * voxels);
}

MatchingImage image_with_hole(unsigned seed, const Voxel& hole) {
    const auto grid = plain_grid({24, 22, 20});
    const imaging::Volume image = sampled(grid, Texture(), 0.2, seed);
    imaging::Volume seen(grid, CV_8UC1);
    for_each_voxel(seen, [&](const Eigen::Vector3d& index, std::int64_t offset) {
        seen.data<std::uint8_t>()[offset] = (index - Eigen::Vector3d(hole[0], hole[1], hole[2])).norm() > 2;
    });
    return matching_image(image, seen, grid, SearchRegion(grid), Similarity::SelfSimilarityContext);
}

// Rows cut by holes and borders are where the fast path could count voxels that are not seen, or twice.
TEST(BlockCost, IsItsPlainDefinitionEverywhere) {
    const MatchingImage moving = image_with_hole(1, {8, 9, 9}), fixed = image_with_hole(2, {15, 12, 10});
    int finite = 0, infinite = 0;
    for (int n = 0; n < 4000; ++n) {
        const Block block{{(7 * n) % 24, (5 * n) % 22, (3 * n) % 20}, 3, 0.1, 1};
        const Voxel at{(11 * n) % 30 - 3, (13 * n) % 28 - 3, (17 * n) % 26 - 3};
        const double expected = plain_cost(moving, fixed, block, at),
                     cost = cost_lattice(moving, fixed, block, at, 0).costs[0];
        if (std::isinf(expected)) {
            ++infinite;
            EXPECT_TRUE(std::isinf(cost));
        } else {
            ++finite;
            EXPECT_NEAR(cost, expected, 1e-12);
        }
    }
    EXPECT_GT(finite, 50);
    EXPECT_GT(infinite, 50);
}

// A hole of one value is padding; real tissue with noise is not.
TEST(SeenRegion, LeavesOutPaddingAlone) {
    const auto grid = plain_grid({20, 20, 20});
    imaging::Volume image = sampled(grid, Texture(), 0.01);
    for_each_voxel(image, [&](const Eigen::Vector3d& index, std::int64_t offset) {
        if (index[0] >= 12) image.data<float>()[offset] = 0;
    });
    const imaging::Volume seen = seen_region(image);
    for_each_voxel(seen, [&](const Eigen::Vector3d& index, std::int64_t offset) {
        EXPECT_EQ(seen.data<std::uint8_t>()[offset] != 0, index[0] < 12) << index.transpose();
    });
}

TEST(QuadraticFit, IsExactOnAParabola) {
    Eigen::Matrix3d hessian;
    hessian << 3, 0.5, -0.2, 0.5, 2, 0.3, -0.2, 0.3, 1.5;
    const Eigen::Vector3d minimum(0.3, -0.4, 0.2);
    std::array<double, 27> costs;
    for (int n = 0; n < 27; ++n) {
        const Eigen::Vector3d x(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1);
        costs[static_cast<std::size_t>(n)] = 7 + 0.5 * (x - minimum).dot(hessian * (x - minimum));
    }
    const auto fit = fit_quadratic(costs);
    ASSERT_TRUE(fit);
    EXPECT_LT((fit->minimum - minimum).norm(), 1e-12);
    EXPECT_LT((fit->hessian - hessian).norm(), 1e-12);
}

// Without curvature there is no minimum to report, and an unseen neighbour leaves none to trust.
TEST(QuadraticFit, RefusesFlatAndUnseenCosts) {
    std::array<double, 27> costs;
    costs.fill(0.5);
    EXPECT_FALSE(fit_quadratic(costs));
    costs[3] = std::numeric_limits<double>::infinity();
    EXPECT_FALSE(fit_quadratic(costs));
}

}  // namespace
}  // namespace tissuewarp::registration::detail
