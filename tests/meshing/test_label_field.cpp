#include "label_shapes.hpp"
#include "meshing/detail/label_field.hpp"
#include "meshing/detail/surface_seeds.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <random>
#include <set>
#include <vector>

namespace tissuewarp::meshing::detail {
namespace {

LabelGrid grid_of(const imaging::Volume& labels) {
    return make_label_grid(labels, {}, 3);
}

/// Local coordinates of a point of an image whose axes are the patient's.
Eigen::Array3d local(const LabelGrid& grid, const Eigen::Vector3d& point) {
    return point.array() - grid.spacing * Eigen::Array3d(grid.origin[0], grid.origin[1], grid.origin[2]);
}

TEST(LabelGrid, CropsAndPads) {
    const LabelGrid grid = grid_of(paint(meshing::grid(20), [](const Eigen::Vector3d& p) {
        return p[0] > 4.5 && p[0] < 9.5 && p[1] < 2.5 && p[2] > 17.5 ? 40 : 0;
    }));
    EXPECT_EQ(grid.origin, (std::array<int, 3>{2, -3, 15}));
    EXPECT_EQ(grid.size, (std::array<int, 3>{11, 9, 8}));
    EXPECT_EQ(grid.values, (std::vector<int>{0, 40}));
    EXPECT_EQ(std::count(grid.classes.begin(), grid.classes.end(), 1), 5 * 3 * 2);
    EXPECT_EQ(grid.classes[grid.offset(3, 3, 3)], 1);
}

TEST(LabelGrid, SpecksGoToTheirSurroundingsAndTheLargestPieceStays) {
    LabelGrid grid = grid_of(paint(meshing::grid(20), [](const Eigen::Vector3d& p) {
        if (p == Eigen::Vector3d(5, 5, 5)) return 2;     // inside label 1
        if (p == Eigen::Vector3d(18, 18, 18)) return 3;  // all there is of label 3
        return p.maxCoeff() < 10 ? 1 : 0;
    }));
    // Label 2 is a single voxel too, but its only piece: both stay; a second voxel of label 3 goes.
    grid.classes[grid.offset(12 + 3, 3, 3)] = 3;
    const std::vector<double> voxels(4, 2.0);
    EXPECT_EQ(remove_specks(grid, voxels), 0);  // equally large pieces: none is smaller than the largest
    grid.classes[grid.offset(18 + 3, 18 + 3, 17 + 3)] = 3;
    EXPECT_EQ(remove_specks(grid, voxels), 1);
    EXPECT_EQ(std::count(grid.classes.begin(), grid.classes.end(), 3), 2);
    EXPECT_EQ(std::count(grid.classes.begin(), grid.classes.end(), 2), 1);
}

/// By a flood from each voxel that has no number yet.
std::vector<std::int32_t> flooded(const LabelGrid& grid) {
    std::vector<std::int32_t> number(grid.voxel_count(), -1);
    std::int32_t next = 0;
    for (std::size_t start = 0; start < number.size(); ++start) {
        if (number[start] >= 0) continue;
        std::vector<std::array<int, 3>> stack;
        const auto reach = [&](int i, int j, int k) {
            if (i < 0 || j < 0 || k < 0 || i >= grid.size[0] || j >= grid.size[1] || k >= grid.size[2]) return;
            const std::size_t v = grid.offset(i, j, k);
            if (number[v] >= 0 || grid.classes[v] != grid.classes[start]) return;
            number[v] = next;
            stack.push_back({i, j, k});
        };
        const auto at = static_cast<int>(start);
        reach(at % grid.size[0], at / grid.size[0] % grid.size[1], at / grid.size[0] / grid.size[1]);
        while (!stack.empty()) {
            const auto [i, j, k] = stack.back();
            stack.pop_back();
            for (const int step : {-1, 1}) {
                reach(i + step, j, k);
                reach(i, j + step, k);
                reach(i, j, k + step);
            }
        }
        ++next;
    }
    return number;
}

TEST(LabelGrid, PiecesAreThoseOfAFlood) {
    std::mt19937 random(7);
    for (const int classes : {1, 2, 3}) {
        LabelGrid grid;
        grid.size = {13, 11, 9};
        grid.classes.resize(13 * 11 * 9);
        for (auto& voxel : grid.classes) voxel = static_cast<std::uint16_t>(random() % static_cast<unsigned>(classes));
        const Components components = connected_components(grid, grid.classes);
        EXPECT_EQ(components.of_voxel, flooded(grid));
        ASSERT_EQ(components.class_of.size(), components.voxels.size());
        std::vector<std::int64_t> counted(components.voxels.size(), 0);
        for (std::size_t v = 0; v < grid.voxel_count(); ++v) {
            const auto c = static_cast<std::size_t>(components.of_voxel[v]);
            ++counted[c];
            EXPECT_EQ(components.class_of[c], grid.classes[v]);
        }
        EXPECT_EQ(components.voxels, counted);
    }
}

TEST(LabelField, APlaneStaysHalfwayBetweenVoxels) {
    const LabelGrid grid =
        grid_of(paint(meshing::grid(30), [](const Eigen::Vector3d& p) { return p[0] < 14.2 ? 1 : 2; }));
    for (double smoothing : {0.0, 0.8, 1.5}) {
        const LabelField field(grid, smoothing);
        for (double y : {12.0, 12.3, 15.5}) {
            EXPECT_EQ(field(local(grid, {14.49, y, 15})), 1);
            EXPECT_EQ(field(local(grid, {14.51, y, 15})), 2);
        }
    }
}

TEST(LabelField, SmoothsASphereBetterThanItsVoxels) {
    // Radius at which the label changes along rays; voxels alone are off by up to 0.87.
    const Eigen::Vector3d centre(15, 15, 15);
    const LabelGrid grid =
        grid_of(paint(meshing::grid(31), [&](const Eigen::Vector3d& p) { return (p - centre).norm() < 10.0 ? 1 : 0; }));
    const LabelField field(grid, 0.8);
    std::srand(1);
    for (int ray = 0; ray < 200; ++ray) {
        const Eigen::Vector3d direction = Eigen::Vector3d::Random().normalized();
        double inside = 0.0, outside = 15.0;
        while (outside - inside > 1e-4) {
            const double middle = 0.5 * (inside + outside);
            (field(local(grid, centre + middle * direction)) == 1 ? inside : outside) = middle;
        }
        EXPECT_NEAR(inside, 10.0, 0.55);  // voxels at exactly 10 are out: 9.5 along the axes
    }
}

TEST(LabelField, KeepsAPlateOfOneVoxel) {
    const LabelGrid grid = grid_of(paint(meshing::grid(20), [](const Eigen::Vector3d& p) {
        return p.minCoeff() > 3 && p.maxCoeff() < 16 && p[2] == 10 ? 1 : 0;
    }));
    const LabelField field(grid, 0.8);
    double low = 9.0, high = 11.0;
    while (field(local(grid, {10, 10, low})) == 0 && low < 10.0) low += 0.01;
    while (field(local(grid, {10, 10, high})) == 0 && high > 10.0) high -= 0.01;
    EXPECT_NEAR(high - low, 1.0, 0.35);
}

TEST(LabelField, IsBackgroundOutsideTheGrid) {
    const LabelGrid grid = grid_of(paint(meshing::grid(4), [](const Eigen::Vector3d&) { return 1; }));
    const LabelField field(grid, 0.8);
    EXPECT_EQ(field(Eigen::Array3d(-1, 3, 3)), 0);
    EXPECT_EQ(field(Eigen::Array3d(3, 1e9, 3)), 0);
    EXPECT_EQ(field(local(grid, {1.5, 1.5, 1.5})), 1);
}

TEST(SurfaceSeeds, StandOnEveryPieceAndKeepTheirDistance) {
    const std::vector<Eigen::Vector3d> centres{{8, 8, 8}, {30, 8, 8}, {8, 30, 20}};
    const LabelGrid grid = grid_of(paint(meshing::grid(40), [&](const Eigen::Vector3d& p) {
        for (std::size_t b = 0; b < centres.size(); ++b)
            if ((p - centres[b]).norm() < 5.0) return b == 0 ? 2 : 1;
        return 0;
    }));
    const LabelField field(grid, 0.8);
    const std::vector<double> edge(3, 4.0);
    const auto seeds = surface_seeds(grid, field, edge, {0, 0, 0});
    std::vector<int> count(centres.size(), 0);
    for (const SurfaceSeed& seed : seeds) {
        EXPECT_NE(field(seed.inside), field(seed.outside));
        for (std::size_t b = 0; b < centres.size(); ++b)
            count[b] += (seed.inside - local(grid, centres[b])).matrix().norm() < 7.0;
    }
    for (int n : count) EXPECT_GE(n, 4);
    for (std::size_t a = 0; a < seeds.size(); ++a)
        for (std::size_t b = 0; b < a; ++b)
            EXPECT_GE(0.5 * (seeds[a].inside + seeds[a].outside - seeds[b].inside - seeds[b].outside).matrix().norm(),
                      0.25 * 4.0);
    struct Impatient : Observer {
        bool cancel_requested() override { return true; }
    } impatient;
    EXPECT_THROW((void)surface_seeds(grid, field, edge, {0, 0, 0}, impatient), Cancelled);
}

}  // namespace
}  // namespace tissuewarp::meshing::detail
