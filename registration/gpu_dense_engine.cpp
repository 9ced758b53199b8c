// The passes of dense forces on a device: displacement of the working grid's voxels, the fixed image read where they
// go, its descriptors, products summed in cells. Kernels: shaders/kernels/match_*.comp, blocks:
// shaders/chunks/match*.glsl.

#include "registration/detail/dense_cells.hpp"
#include "registration/detail/dense_engine.hpp"
#include "registration/detail/gpu_match_layout.hpp"
#include "registration/detail/template_images.hpp"

#include "core/errors.hpp"
#include "imaging/filters.hpp"
#include "shaders/buffer.hpp"
#include "shaders/catalogue.hpp"
#include "shaders/program.hpp"
#include "shaders/readback.hpp"

#include <array>
#include <cstring>
#include <map>
#include <optional>
#include <string>

namespace tissuewarp::registration::detail {

namespace {

using shaders::Buffer;
using shaders::CurrentContext;
using shaders::MatchPass;
using shaders::Program;
using shaders::StorageBuffer;
using Words = Buffer<std::uint32_t>;
using Floats = Buffer<float>;
using Blocks = std::map<std::string, const StorageBuffer*>;

/// What a level of the template keeps on the device.
struct Level {
    const MatchingImage& moving;
    imaging::Geometry wide;
    CellGrid cells;
    std::vector<std::array<std::uint32_t, 2>> layers;  // first and count in `growth`
    Words owner, descriptors, counts;
    Buffer<MatchElement> elements;
    Buffer<GrownVoxel> growth;
    std::optional<Floats> fixed;  // smoothed for this grid

    Level(const shaders::Device& device, const meshing::TetMesh& mesh, const MatchingImage& image,
          const MatchLayout& layout)
        : moving(image),
          wide(layout.wide),
          cells(image.grid),
          layers(layout.layers),
          owner(device, layout.owner, "elements of voxels"),
          descriptors(device, words_of(image), "descriptors of the moving image"),
          counts(device, layout.counts, "voxels that count"),
          elements(device, elements_of(mesh, layout.wide), "elements at rest"),
          growth(device, layout.growth, "voxels about the mesh") {}

    [[nodiscard]] std::size_t wide_voxels() const { return owner.size(); }
    [[nodiscard]] std::size_t voxels() const { return counts.size(); }
};

/// What passes leave for each other.
struct Memory {
    Buffer<MatchGridBlock> grid;
    Buffer<Float4> nodes;
    std::array<Floats, 3> field;
    Floats value;
    Words seen;
    std::array<Floats, 2> smoothed;
    std::array<Words, 2> eroded;
    std::array<Floats, 6> distance;
    Buffer<std::array<float, 2>> partial;
    Floats mean;
    Words descriptors, shown;
    Buffer<MatchCell> cells;
    shaders::Readback readback;

    /// Large enough for a level; those before are smaller.
    Memory(const shaders::Device& device, std::size_t node_count, const Level& finest)
        : Memory(device, node_count, finest.wide_voxels(), finest.voxels(), finest.cells.count()) {}

private:
    Memory(const shaders::Device& device, std::size_t node_count, std::size_t wide, std::size_t voxels,
           std::size_t cell_count)
        : grid(device, 1, "grids of matching"),
          nodes(device, node_count, "displacements"),
          field{Floats(device, wide, "field"), Floats(device, wide, "field"), Floats(device, wide, "field")},
          value(device, wide, "pulled-back image"),
          seen(device, wide, "what it shows"),
          smoothed{Floats(device, wide, "smoothed differences"), Floats(device, wide, "smoothed differences")},
          eroded{Words(device, wide, "what descriptors show"), Words(device, wide, "what descriptors show")},
          distance{Floats(device, wide, "patch distances"), Floats(device, wide, "patch distances"),
                   Floats(device, wide, "patch distances"), Floats(device, wide, "patch distances"),
                   Floats(device, wide, "patch distances"), Floats(device, wide, "patch distances")},
          partial(device, shaders::match_partials, "partial sums of differences"),
          mean(device, 1, "mean difference"),
          descriptors(device, 3 * voxels, "descriptors of the pulled-back image"),
          shown(device, voxels, "where they count"),
          cells(device, cell_count, "products in cells"),
          readback(device, cells.bytes(), "products in cells on their way down") {}
};

void require_limits(const shaders::Device& device) {
    constexpr int blocks_of_describe = 11;
    if (device.limits().storage_blocks < blocks_of_describe)
        throw GpuUnavailable("dense forces: " + device.renderer() + " offers " +
                             std::to_string(device.limits().storage_blocks) +
                             " storage blocks per shader; they need 11; take another device or the CPU");
}

std::vector<Level> levels_of(const shaders::Device& device, const PreparedModel& prepared) {
    require_limits(device);
    std::vector<Level> levels;
    for (const MatchingImage& moving : prepared.image->blocks.images().levels)
        levels.emplace_back(device, prepared.model.mesh, moving, match_layout(prepared.model.mesh, moving));
    return levels;
}

class GpuDenseEngine : public DenseEngine {
public:
    GpuDenseEngine(const PreparedModel& prepared, int gpu_index)
        : device_(gpu_index),
          programs_(device_),
          levels_(levels_of(device_, prepared)),
          memory_(device_, static_cast<std::size_t>(prepared.model.mesh.node_count()), levels_.back()) {}

    void set_fixed(const SeenImage& fixed) override {
        fixed_ = fixed.image;
        const imaging::Volume& seen = fixed.seen;
        std::vector<std::uint32_t> words((seen.voxels.total() + 3) / 4);
        std::memcpy(words.data(), seen.voxels.data, seen.voxels.total());
        fixed_seen_.reset();
        fixed_seen_.emplace(device_, words, "what the fixed image shows");
        for (Level& level : levels_) level.fixed.reset();
    }

    DenseForces forces(const State& state, std::size_t number) override {
        Level& level = levels_.at(number);
        if (!level.fixed) {
            const imaging::Volume smooth = smoothed_for(fixed_, level.moving.grid);
            level.fixed.emplace(device_, std::span(smooth.data<float>(), smooth.voxels.total()), "fixed image");
        }
        const CurrentContext current = device_.make_current();
        upload(level, state);
        const Blocks blocks = blocks_of(level);
        pull_back(level, blocks);
        describe(level, blocks);
        return forces_of(products(level, blocks), level.cells, level.moving.grid);
    }

private:
    shaders::Device device_;
    shaders::ProgramCache programs_;
    std::vector<Level> levels_;
    Memory memory_;
    imaging::Volume fixed_;
    std::optional<Words> fixed_seen_;

    [[nodiscard]] Blocks blocks_of(const Level& level) const {
        const Memory& m = memory_;
        Blocks blocks{{"MatchGrid", &m.grid},
                      {"MatchOwner", &level.owner},
                      {"MatchElements", &level.elements},
                      {"MatchNodes", &m.nodes},
                      {"MatchGrowth", &level.growth},
                      {"MatchFixed", &*level.fixed},
                      {"MatchFixedSeen", &*fixed_seen_},
                      {"MatchValue", &m.value},
                      {"MatchPartial", &m.partial},
                      {"MatchMean", &m.mean},
                      {"MatchDescriptors", &m.descriptors},
                      {"MatchShown", &m.shown},
                      {"MatchMoving", &level.descriptors},
                      {"MatchCounts", &level.counts},
                      {"MatchCells", &m.cells},
                      {"MatchSeen", &m.seen}};
        for (std::size_t axis = 0; axis < 3; ++axis) blocks[std::string("MatchField") + "XYZ"[axis]] = &m.field[axis];
        for (std::size_t pair = 0; pair < 6; ++pair) blocks["MatchDistance" + std::to_string(pair)] = &m.distance[pair];
        return blocks;
    }

    const Program& program(MatchPass pass) { return programs_.get(shaders::match_program(pass, descriptor_reach)); }

    void run(MatchPass pass, std::size_t invocations, Blocks blocks, const Blocks& own = {}) {
        for (const auto& [name, buffer] : own) blocks[name] = buffer;
        const Program& what = program(pass);
        for (const shaders::StorageBlock& block : what.storage_blocks()) blocks.at(block.name)->bind(block.binding);
        what.dispatch(invocations);
        shaders::storage_barrier();
    }

    void upload(const Level& level, const State& state) {
        memory_.grid.upload(std::array{match_grid_block(level.wide, fixed_.geometry, level.cells, state.placement)});
        std::vector<Float4> nodes;
        for (const auto& u : state.displacement.colwise()) nodes.push_back(packed(u));
        memory_.nodes.upload(nodes);
    }

    /// Leaves values and what is seen on the wide grid.
    void pull_back(const Level& level, const Blocks& blocks) {
        run(MatchPass::Field, level.wide_voxels(), blocks);
        for (const auto& [first, count] : level.layers) {
            program(MatchPass::Grow).set(0, first);
            program(MatchPass::Grow).set(1, count);
            run(MatchPass::Grow, count, blocks);
        }
        run(MatchPass::Sample, level.wide_voxels(), blocks);
    }

    void describe(const Level& level, const Blocks& blocks) {
        Memory& m = memory_;
        run(MatchPass::Difference,
            std::size_t{shaders::match_partials} * program(MatchPass::Difference).workgroup_size(), blocks);
        run(MatchPass::Mean, shaders::match_partials, blocks);
        for (std::uint32_t pair = 0; pair < 6; ++pair) {
            program(MatchPass::Distance).set(0, pair);
            run(MatchPass::Distance, level.wide_voxels(), blocks, {{"MatchTarget", &m.smoothed[0]}});
            smooth(level, 1, m.smoothed[0], m.smoothed[1], blocks);
            smooth(level, 2, m.smoothed[1], m.distance[pair], blocks);
        }
        erode(level, 0, m.seen, m.eroded[0], blocks);
        erode(level, 1, m.eroded[0], m.eroded[1], blocks);
        erode(level, 2, m.eroded[1], m.eroded[0], blocks);
        run(MatchPass::Describe, level.voxels(), blocks, {{"MatchSeen", &m.eroded[0]}});
    }

    void smooth(const Level& level, std::uint32_t axis, const Floats& from, const Floats& to, const Blocks& blocks) {
        program(MatchPass::Smooth).set(0, axis);
        run(MatchPass::Smooth, level.wide_voxels(), blocks, {{"MatchSource", &from}, {"MatchTarget", &to}});
    }

    void erode(const Level& level, std::uint32_t axis, const Words& from, const Words& to, const Blocks& blocks) {
        program(MatchPass::Erode).set(0, axis);
        run(MatchPass::Erode, level.wide_voxels(), blocks, {{"MatchMaskSource", &from}, {"MatchMaskTarget", &to}});
    }

    std::vector<CellSums> products(const Level& level, const Blocks& blocks) {
        const std::size_t count = level.cells.count();
        program(MatchPass::Forces).set(0, static_cast<std::uint32_t>(count));
        run(MatchPass::Forces, count * program(MatchPass::Forces).workgroup_size(), blocks);
        const auto bytes = memory_.readback.fetch(memory_.cells, count * sizeof(MatchCell));
        std::vector<CellSums> sums(count);
        for (std::size_t n = 0; n < count; ++n) {
            MatchCell cell;
            std::memcpy(&cell, bytes.data() + n * sizeof cell, sizeof cell);
            sums[n] = sums_of(cell, level.cells.first_voxel(n));
        }
        return sums;
    }
};

}  // namespace

std::unique_ptr<DenseEngine> make_gpu_dense_engine(const PreparedModel& prepared, int gpu_index) {
    return std::make_unique<GpuDenseEngine>(prepared, gpu_index);
}

}  // namespace tissuewarp::registration::detail
