// Dense forces on a device: displacement of the working grid's voxels, the fixed image read where they go, its
// descriptors, products summed in cells; and blocks, in the same image.

#include "registration/detail/dense_cells.hpp"
#include "registration/detail/gpu_block_engine.hpp"
#include "registration/detail/image_engine.hpp"
#include "registration/detail/template_images.hpp"

#include <tbb/parallel_for.h>

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

std::vector<Level> levels_of(const shaders::Device& device, const PreparedModel& prepared) {
    std::vector<Level> levels;
    for (const MatchingImage& moving : prepared.image->blocks.images().levels)
        levels.emplace_back(device, prepared.model.mesh, moving, match_layout(prepared.model.mesh, moving));
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

    Memory(const shaders::Device& device, std::size_t node_count, const Level& finest)
        : nodes(device, node_count, "displacements"),
          field{GpuFloats(device, finest.wide_voxels(), "field"), GpuFloats(device, finest.wide_voxels(), "field"),
                GpuFloats(device, finest.wide_voxels(), "field")},
          descriptors(device, 3 * finest.voxels(), "descriptors of the pulled-back image"),
          shown(device, finest.voxels(), "where they count"),
          cells(device, finest.cells.count(), "products in cells") {}
};

class GpuImageEngine : public ImageEngine {
public:
    GpuImageEngine(const PreparedModel& prepared, int gpu_index)
        : matching_(gpu_index),
          levels_(levels_of(matching_.device(), prepared)),
          memory_(matching_.device(), static_cast<std::size_t>(prepared.model.mesh.node_count()), levels_.back()),
          blocks_(matching_, described(levels_), prepared.image->blocks.options().block_radius) {}

    /// The device smooths while the processor prepares the first search.
    void begin_fixed(const imaging::Volume& image) override {
        matching_.set_image(image);
        for (const Level& level : levels_) matching_.begin_smoothing(level.moving.grid.spacing[0]);
    }

    void finish_fixed(const SeenImage& fixed) override { matching_.set_seen(fixed.seen); }

    BlockEngine& blocks() override { return blocks_; }

    DenseForces forces(const State& state, std::size_t number) override {
        const Level& level = levels_.at(number);
        const shaders::CurrentContext current = matching_.device().make_current();
        pull_back(level, state);
        matching_.describe(level.wide, memory_.descriptors, memory_.shown);
        return forces_of(products(level), level.cells, level.moving.grid, windows_);
    }

private:
    MatchDevice matching_;
    std::vector<Level> levels_;
    Memory memory_;
    GpuBlockEngine blocks_;
    std::vector<CellSums> sums_;  // of the cells of the level looked at last
    WindowMemory windows_;

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

    const std::vector<CellSums>& products(const Level& level) {
        const std::size_t count = level.cells.count();
        const GpuBlocks own{{"MatchDescriptors", &memory_.descriptors},
                            {"MatchShown", &memory_.shown},
                            {"MatchMoving", &level.descriptors},
                            {"MatchCounts", &level.counts},
                            {"MatchCells", &memory_.cells}};
        const auto& program = matching_.program(MatchPass::Forces);
        program.set(0, static_cast<std::uint32_t>(count));
        matching_.run(MatchPass::Forces, count * static_cast<std::size_t>(program.workgroup_size()), {&own});
        const auto bytes = matching_.fetch(memory_.cells, count * sizeof(MatchCell));
        sums_.resize(count);
        tbb::parallel_for(std::size_t{0}, count, [&](std::size_t n) {
            MatchCell cell;
            std::memcpy(&cell, bytes.data() + n * sizeof cell, sizeof cell);
            sums_[n] = cell.voxels > 0 ? sums_of(cell, level.cells.first_voxel(n)) : CellSums{};
        });
        return sums_;
    }
};

}  // namespace

std::unique_ptr<ImageEngine> make_gpu_image_engine(const PreparedModel& prepared, int gpu_index) {
    return std::make_unique<GpuImageEngine>(prepared, gpu_index);
}

}  // namespace tissuewarp::registration::detail
