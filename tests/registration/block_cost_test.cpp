/// The cost of a block, row by row, against its plain definition; the parabola through its minimum.
#include "registration/matching/blocks/block_cost.hpp"
#include "registration/matching/blocks/quadratic_fit.hpp"

#include "tests/registration/textured_phantom.hpp"

#include <Eigen/Eigenvalues>

#include <gtest/gtest.h>

#include <cmath>

namespace tissuewarp::registration::detail {
namespace {

using namespace test;

bool is_seen(const MatchingImage& image, const Voxel& v) {
    for (std::size_t a = 0; a < 3; ++a)
        if (v[a] < 0 || v[a] >= image.grid.size[a]) return false;
    return image.seen[static_cast<std::size_t>(image.offset(v))] > 0;
}

/// The mean squared difference of descriptors by its definition, voxel by voxel, over the rows at given offsets.
double plain_cost(const MatchingImage& moving, const MatchingImage& fixed, const Block& block, const Voxel& at,
                  const std::vector<int>& rows) {
    double sum = 0;
    int voxels = 0;
    for (const int k : rows)
        for (const int j : rows)
            for (int i = -block.radius; i <= block.radius; ++i) {
                const Voxel m{block.centre[0] + i, block.centre[1] + j, block.centre[2] + k};
                const Voxel f{at[0] + i, at[1] + j, at[2] + k};
                if (!is_seen(moving, m) || !is_seen(fixed, f)) continue;
                ++voxels;
                for (std::size_t c = 0; c < 12; ++c) {
                    const double a = moving.descriptors[12 * static_cast<std::size_t>(moving.offset(m)) + c];
                    const double b = fixed.descriptors[12 * static_cast<std::size_t>(fixed.offset(f)) + c];
                    sum += (a - b) * (a - b) / (255.0 * 255.0);
                }
            }
    const double all = double(rows.size() * rows.size()) * (2 * block.radius + 1);
    return voxels < block.least_share * all ? std::numeric_limits<double>::infinity() : sum / (12.0 * voxels);
}

MatchingImage image_with_hole(unsigned seed, const Voxel& hole) {
    const auto grid = plain_grid({24, 22, 20});
    const imaging::Volume image = sampled(grid, Texture(), 0.2, seed);
    imaging::Volume seen(grid, CV_8UC1);
    for_each_voxel(seen, [&](const Eigen::Vector3d& index, std::int64_t offset) {
        seen.data<std::uint8_t>()[offset] = (index - Eigen::Vector3d(hole[0], hole[1], hole[2])).norm() > 2;
    });
    return matching_image(image, seen, grid, SearchRegion(grid));
}

/// Every cost of lattices of a reach about many places, against the plain definition. Counts the finite and the others.
std::pair<int, int> compare_lattices(int reach, int stride, const std::vector<int>& rows) {
    const MatchingImage moving = image_with_hole(1, {8, 9, 9}), fixed = image_with_hole(2, {15, 12, 10});
    int finite = 0, infinite = 0;
    std::array<BlockWindow, 2> windows;
    for (int n = 0; n < 600; ++n) {
        const Block block{{(7 * n) % 24, (5 * n) % 22, (3 * n) % 20}, 4, 0.1};
        const Voxel at{(11 * n) % 30 - 3, (13 * n) % 28 - 3, (17 * n) % 26 - 3};
        Surroundings shown(moving, block.centre, block.radius + n % 3, windows[0]),
            about(fixed, at, block.radius + reach + n % 2, windows[1]);
        const CostLattice lattice = BlockCosts(shown, about, block).lattice(at, reach, stride);
        for (std::size_t m = 0; m < lattice.costs.size(); ++m) {
            const double expected = plain_cost(moving, fixed, block, lattice.place(m), rows);
            ++(std::isinf(expected) ? infinite : finite);
            if (std::isinf(expected))
                EXPECT_TRUE(std::isinf(lattice.costs[m]));
            else
                EXPECT_NEAR(lattice.costs[m], expected, 1e-12);
        }
    }
    return {finite, infinite};
}

// Rows cut by holes and borders are where the fast path could count voxels that are not seen, or twice; a reach of 1, 2
// and 0 takes it through three, four and one, and one shift at a time.
TEST(BlockCost, IsItsPlainDefinitionEverywhere) {
    for (const int reach : {0, 1, 2}) {
        const auto [finite, infinite] = compare_lattices(reach, 1, {-4, -3, -2, -1, 0, 1, 2, 3, 4});
        EXPECT_GT(finite, 50);
        EXPECT_GT(infinite, 50);
    }
}

// A first look at some of the rows: symmetric about the centre, or it prefers one side.
TEST(BlockCost, OfSomeRowsIsItsPlainDefinition) {
    EXPECT_GT(compare_lattices(1, 3, {-3, 0, 3}).first, 50);
    EXPECT_GT(compare_lattices(1, 2, {-4, -2, 0, 2, 4}).first, 50);
}

// Costs asked for beyond what was cut out are those of surroundings cut there.
TEST(BlockCost, IsTheSameFromAnySurroundings) {
    const MatchingImage moving = image_with_hole(1, {8, 9, 9}), fixed = image_with_hole(2, {15, 12, 10});
    const Block block{{12, 11, 10}, 4, 0.1};
    std::array<BlockWindow, 4> windows;
    Surroundings shown(moving, {11, 11, 11}, 6, windows[0]), about(fixed, {10, 10, 10}, 7, windows[1]);
    BlockCosts costs(shown, about, block);
    for (const Voxel& at : {Voxel{11, 9, 10}, Voxel{12, 12, 8}, Voxel{15, 10, 10}, Voxel{10, 10, 10}}) {
        Surroundings block_alone(moving, block.centre, block.radius, windows[2]),
            here(fixed, at, block.radius + 1, windows[3]);
        EXPECT_EQ(costs.lattice(at, 1, 1).costs, BlockCosts(block_alone, here, block).lattice(at, 1, 1).costs);
    }
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
    EXPECT_NEAR(fit->largest_curvature, hessian.operatorNorm(), 1e-12);
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
