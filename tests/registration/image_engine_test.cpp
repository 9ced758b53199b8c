/// Dense forces on a device (Mesa's llvmpipe where there is no GPU) against their twin on the processor.
#include "registration/matching/dense/image_engine.hpp"

#include "core/errors.hpp"
#include "imaging/filters.hpp"
#include "registration/evaluation.hpp"
#include "registration/field/growth.hpp"
#include "registration/matching/blocks/block_search.hpp"
#include "registration/matching/gpu/gpu_match_layout.hpp"
#include "tests/registration/textured_phantom.hpp"
#include "tests/support/label_shapes.hpp"

#include <Eigen/Eigenvalues>

#include <gtest/gtest.h>

namespace tissuewarp::registration::detail {
namespace {

using namespace test;
using imaging::Volume;

constexpr double spacing_mm = 2.0;

PreparedModel textured_model() {
    shapes::Organ organ;
    organ.semi_axes = {22, 19, 17};
    organ.inclusion_radius = 0;
    const Volume labels = shapes::organ_labels(organ, Eigen::Isometry3d::Identity(), spacing_mm);
    PrepareOptions options;
    options.meshing.edge_length = 7;
    PreparedModel prepared = prepare(labels, options);
    ImageModelOptions image;
    image.features.count = 200;
    image.blocks.grid_spacing_mm = spacing_mm;
    image.blocks.levels = 2;
    prepare_image(prepared, sampled(labels.geometry, Texture()), image);
    return prepared;
}

/// A textured organ in a state near to where it went, and what a scanner shows of it there, on another grid, which cuts
/// part of the organ off.
struct Scene {
    PreparedModel prepared = textured_model();
    State state;
    Volume fixed;

    Scene() {
        state.placement = motion(5, {1, 2, -1}, {2, -1, 1.5});
        const Eigen::Matrix3Xd& nodes = prepared.model.mesh.nodes;
        state.displacement = Eigen::Matrix3Xd::Zero(3, nodes.cols());
        for (Eigen::Index n = 0; n < nodes.cols(); ++n)
            state.displacement.col(n) = 0.9 * smooth_displacement(nodes.col(n));
        imaging::Geometry seen = prepared.labels.geometry;
        seen.spacing = {1.7, 2.1, 2.3};
        seen.size[0] -= 8;
        const Eigen::Isometry3d back = state.placement.inverse();
        fixed = sampled(seen, [&](const auto& y) { return 2 - Texture()(before_displacement(back * y)); });
    }
};

double deviation(const DenseForce& force) {
    return 1 / std::sqrt(force.information.norm());
}

/// Both say something in the same cells, where it lies, by how much and how surely; rounding moves a level of eight
/// bits in a few channels. A displacement read from another element, a rim off by a voxel or a window along the wrong
/// axis moves the image pulled back by tenths of voxels.
TEST(ImageEngine, TheDeviceSaysWhatTheProcessorSays) {
    const Scene scene;
    const auto cpu = make_cpu_image_engine(scene.prepared.model.mesh, *scene.prepared.image),
               gpu = make_gpu_image_engine(scene.prepared.model.mesh, *scene.prepared.image);
    cpu->set_fixed(SeenImage(scene.fixed));
    gpu->set_fixed(SeenImage(scene.fixed));
    for (const std::size_t level : {0U, 1U}) {
        const DenseForces expected = cpu->forces(scene.state, level), found = gpu->forces(scene.state, level);
        ASSERT_GT(expected.forces.size(), level == 0 ? 10U : 100U);
        ASSERT_EQ(found.said, expected.said);
        ASSERT_EQ(found.forces.size(), expected.forces.size());
        EXPECT_NEAR(found.agreement, expected.agreement, 1e-3);
        const double voxel = scene.prepared.image->blocks.options().grid_spacing_mm * (level == 0 ? 2 : 1);
        std::vector<double> distances;
        for (std::size_t n = 0; n < found.forces.size(); ++n) {
            EXPECT_LT((found.forces[n].place - expected.forces[n].place).norm(), 0.1 * voxel);
            EXPECT_NEAR(deviation(found.forces[n]) / deviation(expected.forces[n]), 1, 0.05);
            distances.push_back((found.forces[n].shift - expected.forces[n].shift).norm() / voxel);
        }
        EXPECT_LT(summarise(distances).mean, 2e-3);
        EXPECT_LT(summarise(distances).percentile_95, 1e-2);
    }
}

/// Springs with a negative eigenvalue are refused: what a plane edge shows, along one axis, has none in spite of
/// floats.
TEST(ImageEngine, InformationAlongOneAxisHasNoNegativeEigenvalue) {
    const Eigen::Vector3f edge(0.3F, -1.7F, 0.9F);
    imaging::Geometry grid;
    grid.direction = motion(20, {1, 2, -1}, {0, 0, 0}).linear();
    MatchForce cell{};
    cell.voxels = cell.said = 1;
    std::copy(edge.begin(), edge.end(), cell.root.begin());
    const auto force = force_of(cell, {0, 0, 0}, grid);
    ASSERT_TRUE(force);
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(force->information);
    EXPECT_NEAR(axes.eigenvalues()[2], edge.cast<double>().squaredNorm(), 1e-12);
    EXPECT_GT(axes.eigenvalues()[0], -1e-14);
}

// What an image leaves behind must not reach the next one.
TEST(ImageEngine, TheDeviceRepeatsItselfAndTakesAnotherImage) {
    const Scene scene;
    const auto gpu = make_gpu_image_engine(scene.prepared.model.mesh, *scene.prepared.image);
    gpu->set_fixed(SeenImage(scene.fixed));
    const DenseForces first = gpu->forces(scene.state, 1);
    Volume still = scene.prepared.image->image;
    gpu->set_fixed(SeenImage(still));
    const State rest{Eigen::Isometry3d::Identity(), Eigen::Matrix3Xd::Zero(3, scene.state.displacement.cols())};
    EXPECT_NEAR(gpu->forces(rest, 1).agreement, 1, 0.02);
    gpu->set_fixed(SeenImage(scene.fixed));
    const DenseForces again = gpu->forces(scene.state, 1);
    ASSERT_EQ(first.forces.size(), again.forces.size());
    for (std::size_t n = 0; n < first.forces.size(); ++n) {
        EXPECT_EQ(first.forces[n].shift, again.forces[n].shift);
        EXPECT_EQ(first.forces[n].information, again.forces[n].information);
    }
}

/// Blocks of a turned and cut image: the same are found, where the processor finds them, and as surely. A row of a
/// block left out, a walk that stops early or a mask read from another voxel moves matches by voxels, or loses them.
TEST(ImageEngine, TheDeviceFindsTheBlocksThatTheProcessorFinds) {
    const Scene scene;
    const MatchingTemplate& blocks = scene.prepared.image->blocks;
    const Eigen::Matrix3Xd expected = scene.state.placement * blocks.points();
    BlockMatchingOptions options;
    options.rotation = scene.state.placement.linear();
    options.search_mm = 12;
    const auto cpu = make_cpu_image_engine(scene.prepared.model.mesh, *scene.prepared.image),
               gpu = make_gpu_image_engine(scene.prepared.model.mesh, *scene.prepared.image);
    const auto& size = scene.fixed.geometry.size;
    const SeenImage seen(imaging::crop(scene.fixed, {0, 0, 0}, {2 * size[0] / 3, size[1], size[2]}));
    for (const auto& engine : {&cpu, &gpu}) (*engine)->set_fixed(seen);
    const auto search = [&](const std::unique_ptr<ImageEngine>& engine) {
        return search_blocks(blocks, seen.image.geometry, engine->blocks(), expected, options, silent_observer());
    };
    const auto by_cpu = search(cpu), by_gpu = search(gpu);
    ASSERT_GT(by_cpu.size(), 50U);
    ASSERT_LT(by_cpu.size(), 200U) << "blocks cut off are meant to be missing";
    ASSERT_EQ(by_gpu.size(), by_cpu.size());
    std::vector<double> distances;
    for (std::size_t n = 0; n < by_cpu.size(); ++n) {
        ASSERT_EQ(by_gpu[n].point, by_cpu[n].point);
        EXPECT_EQ(by_gpu[n].moving, by_cpu[n].moving);
        EXPECT_NEAR(by_gpu[n].cost, by_cpu[n].cost, 1e-4);
        EXPECT_NEAR(by_gpu[n].uniqueness, by_cpu[n].uniqueness, 0.02);
        EXPECT_NEAR(by_gpu[n].information.norm() / by_cpu[n].information.norm(), 1, 0.05);
        distances.push_back((by_gpu[n].fixed - by_cpu[n].fixed).norm() / spacing_mm);
    }
    EXPECT_LT(summarise(distances).percentile_95, 0.01);
    EXPECT_LT(summarise(distances).maximum, 0.1);
}

/// Blocks that are cut by both images' borders, of fewer columns and of more than a workgroup compares at a time: the
/// same candidates lead to the same places, there and back, at the same costs. A column left out, one counted twice or
/// a slice read a step too late changes a cost by more than rounding of descriptors does.
TEST(ImageEngine, TheDeviceComparesBlocksOfEverySizeAsTheProcessor) {
    PreparedModel prepared = textured_model();
    for (const int radius : {1, 4, 5, 8}) {
        ImageModelOptions image;
        image.features.count = 60;
        image.blocks.grid_spacing_mm = spacing_mm;
        image.blocks.levels = 1;
        image.blocks.block_radius = radius;
        prepare_image(prepared, Volume(prepared.image->image), image);
        const auto& images = prepared.image->blocks.images();
        const imaging::Geometry& grid = images.levels[0].grid;
        const auto& size = prepared.image->image.geometry.size;
        const SeenImage seen(imaging::crop(prepared.image->image, {0, 0, 0}, {2 * size[0] / 3, size[1], size[2]}));
        std::vector<SoughtBlock> blocks;
        for (Eigen::Index n = 0; n < images.points.cols(); ++n) {
            const Eigen::Vector3d index = grid.index(images.points.col(n));
            const Voxel centre{int(std::lround(index[0])), int(std::lround(index[1])), int(std::lround(index[2]))};
            blocks.push_back({centre, {centre[0] + 1, centre[1] - 2, centre[2] + 1}});
        }
        const auto sights = [&](const std::unique_ptr<ImageEngine>& engine) {
            engine->set_fixed(seen);
            std::vector<BlockSight> result(blocks.size());
            engine->blocks()
                .fixed_on(grid, SearchRegion(grid), 0)
                ->look(blocks, 3, 0.05, [&](std::size_t n, const BlockSight& sight) { result[n] = sight; });
            return result;
        };
        const auto by_cpu = sights(make_cpu_image_engine(prepared.model.mesh, *prepared.image)),
                   by_gpu = sights(make_gpu_image_engine(prepared.model.mesh, *prepared.image));
        int found = 0, elsewhere = 0;
        const auto compare = [&](const std::optional<CostLattice>& cpu, const std::optional<CostLattice>& gpu) {
            if (!cpu && !gpu) return;
            ++found;
            if (!cpu || !gpu || cpu->centre != gpu->centre) {
                ++elsewhere;
                return;
            }
            for (std::size_t k = 0; k < cpu->costs.size(); ++k) {
                ASSERT_EQ(std::isfinite(cpu->costs[k]), std::isfinite(gpu->costs[k]));
                if (!std::isfinite(cpu->costs[k])) continue;
                EXPECT_NEAR(cpu->costs[k], gpu->costs[k], 2e-4) << radius;
            }
        };
        for (std::size_t n = 0; n < blocks.size(); ++n) {
            compare(by_cpu[n].forward, by_gpu[n].forward);
            compare(by_cpu[n].back, by_gpu[n].back);
        }
        EXPECT_GT(found, 20) << radius;
        EXPECT_LE(elsewhere, found / 20) << radius;
    }
}

// Buffers that the larger search of an image before left behind must not show.
TEST(ImageEngine, TheDeviceLooksForFewerBlocksAsForMany) {
    const Scene scene;
    const auto& images = scene.prepared.image->blocks.images();
    const auto gpu = make_gpu_image_engine(scene.prepared.model.mesh, *scene.prepared.image);
    gpu->set_fixed(SeenImage(scene.prepared.image->image));
    const imaging::Geometry& grid = images.levels[1].grid;
    std::vector<SoughtBlock> blocks;
    for (Eigen::Index n = 0; n < 60; ++n) {
        const Eigen::Vector3d index = grid.index(images.points.col(n));
        const Voxel centre{int(std::lround(index[0])), int(std::lround(index[1])), int(std::lround(index[2]))};
        blocks.push_back({centre, {centre[0] + 1, centre[1] - 2, centre[2]}});
    }
    const auto fixed = gpu->blocks().fixed_on(grid, SearchRegion(grid), 1);
    const auto found = [&](std::size_t first, int reach) {
        const std::vector<SoughtBlock> some(blocks.begin() + static_cast<std::ptrdiff_t>(first), blocks.end());
        std::vector<Voxel> result(some.size());
        fixed->look(some, reach, 0.05, [&](std::size_t n, const BlockSight& sight) {
            if (sight.back) result[n] = sight.back->centre;
        });
        return result;
    };
    const auto many = found(0, 6), few = found(40, 3);
    for (std::size_t n = 0; n < few.size(); ++n) {
        EXPECT_EQ(few[n], many[40 + n]);
        EXPECT_EQ(few[n], blocks[40 + n].moving);
    }
}

TEST(ImageEngine, RefusesBlocksThatItsSumsDoNotHold) {
    PreparedModel prepared = textured_model();
    ImageModelOptions image;
    image.features.count = 50;
    image.blocks.grid_spacing_mm = spacing_mm;
    image.blocks.levels = 1;
    image.blocks.block_radius = 9;
    prepare_image(prepared, Volume(prepared.image->image), image);
    EXPECT_THROW(static_cast<void>(make_gpu_image_engine(prepared.model.mesh, *prepared.image)), GpuUnavailable);
}

// A ball grows by the octahedra of the city-block distance; a front that turns a corner too early or leaves the grid
// shows.
TEST(Growth, LayersAreThoseOfTheCityBlockDistance) {
    const std::array<int, 3> size{9, 7, 5};
    const auto offset = [&](int i, int j, int k) { return static_cast<std::size_t>(i + size[0] * (j + size[1] * k)); };
    std::vector<std::uint8_t> inside(9 * 7 * 5, 0);
    inside[offset(1, 3, 2)] = 1;
    const auto layers = growth_layers(inside, size, 4);
    ASSERT_EQ(layers.size(), 4U);
    std::vector<int> layer_of(inside.size(), 0);
    for (std::size_t layer = 0; layer < layers.size(); ++layer)
        for (const GrownVoxel& grown : layers[layer]) {
            ASSERT_EQ(layer_of[grown.voxel], 0);
            ASSERT_NE(grown.neighbours, 0U);
            layer_of[grown.voxel] = static_cast<int>(layer) + 1;
        }
    for (int k = 0; k < 5; ++k)
        for (int j = 0; j < 7; ++j)
            for (int i = 0; i < 9; ++i) {
                const int distance = std::abs(i - 1) + std::abs(j - 3) + std::abs(k - 2);
                EXPECT_EQ(layer_of[offset(i, j, k)], distance <= 4 ? distance : 0) << i << ' ' << j << ' ' << k;
            }
    EXPECT_EQ(layers[0].size(), 6U);
    for (const GrownVoxel& grown : layers[0]) EXPECT_EQ(grown.neighbours == 1U, grown.voxel == offset(2, 3, 2));  // −i
}

}  // namespace
}  // namespace tissuewarp::registration::detail
