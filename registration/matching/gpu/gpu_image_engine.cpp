// Dense forces on a device: displacement of the working grid's voxels, the fixed image read where they go, its
// descriptors, products summed in cells, forces from them; and blocks, in the same image.

#include "registration/matching/dense/image_engine.hpp"
#include "registration/matching/dense/rows_of_cells.hpp"
#include "registration/matching/gpu/gpu_block_engine.hpp"
#include "registration/matching/gpu/gpu_echo_engine.hpp"
#include "registration/matching/points/template_images.hpp"

#include <cstring>

namespace tissuewarp::registration::detail {

namespace {

using shaders::Buffer;
using shaders::MatchPass;

/// What a level of the template keeps on the device.
struct Level {
    const MatchingImage& moving;
    imaging::Geometry wide;
    CellGrid cells;
    std::vector<std::array<std::uint32_t, 2>> layers;  // first and count in `growth`
    GpuWords owner, descriptors, counts, seen;
    Buffer<MatchElement> elements;
    Buffer<GrownVoxel> growth;

    Level(const shaders::Device& device, const meshing::TetMesh& mesh, const MatchingImage& image,
          const MatchLayout& layout)
        : moving(image),
          wide(layout.wide),
          cells(image.grid),
          layers(layout.layers),
          owner(device, layout.owner, "elements of voxels"),
          descriptors(device, words_of(image), "descriptors of the moving image"),
          counts(device, layout.counts, "voxels that count"),
          seen(device, std::vector<std::uint32_t>(image.seen.begin(), image.seen.end()),
               "where the moving image is described"),
          elements(device, elements_of(mesh, layout.wide), "elements at rest"),
          growth(device, layout.growth, "voxels about the mesh") {}

    [[nodiscard]] std::size_t wide_voxels() const { return owner.size(); }
    [[nodiscard]] std::size_t voxels() const { return counts.size(); }
    [[nodiscard]] DescribedOnDevice described() const { return {moving.grid, descriptors, seen}; }
};

std::vector<Level> levels_of(const shaders::Device& device, const meshing::TetMesh& mesh, const ImageModel& image) {
    std::vector<Level> levels;
    for (const MatchingImage& moving : image.blocks.images().levels)
        levels.emplace_back(device, mesh, moving, match_layout(mesh, moving));
    return levels;
}

std::vector<DescribedOnDevice> described(const std::vector<Level>& levels) {
    std::vector<DescribedOnDevice> result;
    for (const Level& level : levels) result.push_back(level.described());
    return result;
}

/// What passes leave for each other, large enough for a level; those before are smaller.
struct Memory {
    Buffer<Float4> nodes;
    std::array<GpuFloats, 3> field;
    GpuWords descriptors, shown;
    Buffer<MatchCell> cells;
    std::array<GpuFloats, 2> spread;  // of their sums
    Buffer<MatchForce> forces;

    Memory(const shaders::Device& device, std::size_t node_count, const Level& finest)
        : nodes(device, node_count, "displacements"),
          field{GpuFloats(device, finest.wide_voxels(), "field"), GpuFloats(device, finest.wide_voxels(), "field"),
                GpuFloats(device, finest.wide_voxels(), "field")},
          descriptors(device, 3 * finest.voxels(), "descriptors of the pulled-back image"),
          shown(device, finest.voxels(), "where they count"),
          cells(device, finest.cells.count(), "products in cells"),
          spread{GpuFloats(device, spread_sums * finest.cells.count(), "products in windows"),
                 GpuFloats(device, spread_sums * finest.cells.count(), "products in windows")},
          forces(device, finest.cells.count(), "forces of cells") {}
};

class GpuImageEngine : public ImageEngine {
public:
    GpuImageEngine(const meshing::TetMesh& mesh, const ImageModel& image, int gpu_index)
        : matching_(gpu_index),
          levels_(levels_of(matching_.device(), mesh, image)),
          memory_(matching_.device(), static_cast<std::size_t>(mesh.node_count()), levels_.back()),
          blocks_(matching_, described(levels_), image.blocks.options().block_radius),
          echoes_(matching_) {}

    /// The device smooths while the processor prepares the first search.
    void begin_fixed(const imaging::Volume& image) override {
        matching_.set_image(image);
        for (const Level& level : levels_) matching_.begin_smoothing(level.moving.grid.spacing[0]);
    }

    void finish_fixed(const SeenImage& fixed) override { matching_.set_seen(fixed.seen); }

    BlockEngine& blocks() override { return blocks_; }
    EchoEngine& echoes() override { return echoes_; }

    DenseForces forces(const State& state, std::size_t number) override {
        const Level& level = levels_.at(number);
        const shaders::CurrentContext current = matching_.device().make_current();
        pull_back(level, state);
        matching_.describe(level.wide, memory_.descriptors, memory_.shown);
        sum_products(level);
        solve(level);
        return listed(level);
    }

private:
    MatchDevice matching_;
    std::vector<Level> levels_;
    Memory memory_;
    GpuBlockEngine blocks_;
    GpuEchoEngine echoes_;

    /// Leaves values and what is seen on the wide grid.
    void pull_back(const Level& level, const State& state) {
        std::vector<Float4> nodes;
        for (const auto& u : state.displacement.colwise()) nodes.push_back(packed(u));
        memory_.nodes.upload(nodes);
        matching_.reserve_wide(level.wide_voxels());
        const GpuBlocks fixed = matching_.fixed_for(level.wide, level.moving.grid.spacing[0], state.placement,
                                                    level.cells.centres().size),
                        samples = matching_.samples();
        GpuBlocks own{{"MatchOwner", &level.owner},
                      {"MatchElements", &level.elements},
                      {"MatchNodes", &memory_.nodes},
                      {"MatchGrowth", &level.growth}};
        for (std::size_t axis = 0; axis < 3; ++axis)
            own[std::string("MatchField") + "XYZ"[axis]] = &memory_.field[axis];
        matching_.run(MatchPass::Field, level.wide_voxels(), {&fixed, &own});
        for (const auto& [first, count] : level.layers) {
            matching_.program(MatchPass::Grow).set(0, first);
            matching_.program(MatchPass::Grow).set(1, count);
            matching_.run(MatchPass::Grow, count, {&fixed, &own});
        }
        matching_.run(MatchPass::Sample, level.wide_voxels(), {&fixed, &own, &samples});
    }

    /// Leaves the products of the level's cells.
    void sum_products(const Level& level) {
        const GpuBlocks own{{"MatchDescriptors", &memory_.descriptors},
                            {"MatchShown", &memory_.shown},
                            {"MatchMoving", &level.descriptors},
                            {"MatchCounts", &level.counts},
                            {"MatchCells", &memory_.cells}};
        const auto workgroup = static_cast<std::size_t>(matching_.program(MatchPass::Forces).workgroup_size());
        matching_.run(MatchPass::Forces, level.cells.count() * workgroup, {&own});
    }

    /// Leaves their forces.
    void solve(const Level& level) {
        spread(level, 0, memory_.spread[1], memory_.spread[0]);
        spread(level, 1, memory_.spread[0], memory_.spread[1]);
        spread(level, 2, memory_.spread[1], memory_.spread[0]);
        using Rules = DenseForceRules;
        constexpr std::array rules{Rules::independent_share, Rules::least_square, Rules::least_deviation,
                                   Rules::leakage, Rules::most_shift};
        for (std::size_t n = 0; n < rules.size(); ++n)
            matching_.program(MatchPass::Solve).set(static_cast<int>(n), static_cast<float>(rules[n]));
        const GpuBlocks own{
            {"MatchCells", &memory_.cells}, {"MatchWindows", &memory_.spread[0]}, {"MatchForces", &memory_.forces}};
        matching_.run(MatchPass::Solve, level.cells.count(), {&own});
    }

    void spread(const Level& level, std::uint32_t axis, const GpuFloats& from, const GpuFloats& to) {
        const GpuBlocks own{{"MatchCells", &memory_.cells}, {"MatchSpreadSource", &from}, {"MatchSpreadTarget", &to}};
        matching_.program(MatchPass::Window).set(0, axis);
        matching_.run(MatchPass::Window, spread_sums * level.cells.count(), {&own});
    }

    DenseForces listed(const Level& level) {
        const auto bytes = matching_.fetch(memory_.forces, level.cells.count() * sizeof(MatchForce));
        const auto cell = [&](std::size_t n) {
            MatchForce force;
            std::memcpy(&force, bytes.data() + n * sizeof force, sizeof force);
            return force;
        };
        return listed_forces(
            level.cells,
            [&](std::size_t n) {
                const MatchForce force = cell(n);
                return CellCount{double(force.voxels), 2.0 * force.alike, double(force.structure)};
            },
            [&](std::size_t n) { return force_of(cell(n), level.cells.first_voxel(n), level.moving.grid); });
    }
};

}  // namespace

std::unique_ptr<ImageEngine> make_gpu_image_engine(const meshing::TetMesh& mesh, const ImageModel& image,
                                                   int gpu_index) {
    return std::make_unique<GpuImageEngine>(mesh, image, gpu_index);
}

}  // namespace tissuewarp::registration::detail
