#include "registration/matching/gpu/gpu_block_engine.hpp"

#include "core/errors.hpp"
#include "registration/matching/descriptors/grid_samples.hpp"

#include <tbb/parallel_for.h>

#include <cstring>
#include <limits>
#include <numeric>

namespace tissuewarp::registration::detail {

using shaders::MatchPass;

namespace {

static_assert(shaders::match_walk_steps == most_walk_steps);
static_assert(shaders::match_most_candidates == most_candidates);
static_assert(shaders::match_candidates_one_of == candidates_one_of);

constexpr float nowhere = 1e30F;  // chunks/match.block.glsl

std::array<std::int32_t, 4> packed4(const std::array<int, 3>& v, int w = 0) {
    return {v[0], v[1], v[2], w};
}

double as_cost(float cost) {
    return cost < nowhere ? double(cost) : std::numeric_limits<double>::infinity();
}

template <class T>
T entry(std::span<const std::byte> bytes, std::size_t n) {
    T value;
    std::memcpy(&value, bytes.data() + n * sizeof value, sizeof value);
    return value;
}

void read_walk(const MatchWalk& walk, std::optional<CostLattice>& near) {
    if (walk.end[3] == 0) {
        near.reset();
        return;
    }
    if (!near) near.emplace();
    near->centre = {walk.end[0], walk.end[1], walk.end[2]};
    near->reach = 1;
    near->costs.resize(27);
    std::transform(walk.costs.begin(), walk.costs.begin() + 27, near->costs.begin(), as_cost);
}

class GpuFixedBlocks : public FixedBlocks {
public:
    GpuFixedBlocks(GpuBlockEngine& engine, const DescribedOnDevice& moving, const DescribedOnDevice& fixed)
        : engine_(engine), moving_(moving), fixed_(fixed) {}

    void look(const std::vector<SoughtBlock>& blocks, int reach, double least_share, const Visit& visit,
              const std::function<void()>& meanwhile) override {
        const std::size_t batch = GpuBlockEngine::most_blocks(reach);
        for (std::size_t first = 0; first < blocks.size(); first += batch) {
            const auto some = std::span(blocks).subspan(first, std::min(batch, blocks.size() - first));
            std::vector<MatchSoughtBlock> sought(some.size());
            std::transform(some.begin(), some.end(), sought.begin(), [](const SoughtBlock& block) {
                return MatchSoughtBlock{packed4(block.moving), packed4(block.fixed)};
            });
            engine_.begin_search({moving_, fixed_, reach, least_share}, sought);
            if (first == 0) meanwhile();
            const GpuBlockEngine::Sights sights = engine_.found();
            tbb::parallel_for(tbb::blocked_range<std::size_t>(0, some.size()), [&](const auto& range) {
                BlockSight sight;
                for (std::size_t n = range.begin(); n < range.end(); ++n) {
                    sights.read(n, some[n].fixed, reach, sight);
                    visit(first + n, sight);
                }
            });
        }
    }

private:
    GpuBlockEngine& engine_;
    DescribedOnDevice moving_, fixed_;
};

}  // namespace

GpuBlockEngine::GpuBlockEngine(MatchDevice& matching, std::vector<DescribedOnDevice> moving, int block_radius)
    : matching_(matching),
      moving_(std::move(moving)),
      fixed_(moving_.size()),
      radius_(block_radius),
      there_(matching.device(), 1, "search for blocks"),
      back_(matching.device(), 1, "search for blocks on the way back") {
    constexpr int most_radius = 8;  // 17³ voxels of twelve squares of eight bits are less than 2³²
    if (block_radius > most_radius)
        throw GpuUnavailable("block matching: the sums of blocks of radius " + std::to_string(block_radius) +
                             " do not fit into 32 bits; take a radius of up to 8 voxels or the CPU");
}

std::unique_ptr<FixedBlocks> GpuBlockEngine::fixed_on(const imaging::Geometry& grid, const SearchRegion&,
                                                      std::size_t level) {
    const imaging::Geometry wide = GridSamples::with_rim(grid);
    const auto voxels = static_cast<std::size_t>(grid.voxel_count()),
               wide_voxels = static_cast<std::size_t>(wide.voxel_count());
    auto& [words, shown] = fixed_.at(level);
    reserve(words, matching_.device(), 3 * voxels, "descriptors of the fixed image");
    reserve(shown, matching_.device(), voxels, "where they count");
    matching_.reserve_wide(wide_voxels);
    const shaders::CurrentContext current = matching_.device().make_current();
    const GpuBlocks fixed = matching_.fixed_for(wide, grid.spacing[0], Eigen::Isometry3d::Identity(), {1, 1, 1}),
                    samples = matching_.samples();
    matching_.run(MatchPass::SampleStill, wide_voxels, {&fixed, &samples});
    matching_.describe(wide, *words, *shown);
    shaders::flush();  // what is sought is listed meanwhile
    return std::make_unique<GpuFixedBlocks>(*this, moving_[level], DescribedOnDevice{grid, *words, *shown});
}

std::size_t GpuBlockEngine::most_blocks(int reach) {
    constexpr std::size_t most_costs = 16U << 20U;
    const auto side = static_cast<std::size_t>(2 * reach + 1);
    return std::max<std::size_t>(1, most_costs / (side * side * side));
}

MatchSearchBlock GpuBlockEngine::parameters(const Search& search, std::size_t blocks) const {
    const auto least = [&](int stride) {
        return static_cast<float>(least_voxels(radius_, stride, search.least_share));
    };
    return {packed4(search.shown.grid.size),
            packed4(search.looked.grid.size),
            radius_,
            search.reach,
            first_look_stride,
            first_row(radius_, first_look_stride),
            least(first_look_stride),
            least(1),
            static_cast<std::uint32_t>(blocks),
            0};
}

/// Nothing comes up before the way back is done: what is sought on it is left there by the way forward.
void GpuBlockEngine::begin_search(const Search& search, std::span<const MatchSoughtBlock> blocks) {
    const shaders::Device& device = matching_.device();
    const shaders::CurrentContext current = device.make_current();
    const auto side = static_cast<std::size_t>(2 * search.reach + 1), places = side * side * side;
    const Search home{search.looked, search.shown, search.reach, search.least_share};
    MatchSearchBlock way_back = parameters(home, blocks.size());
    way_back.is_way_back = 1;
    there_.upload(std::array{parameters(search, blocks.size())});
    back_.upload(std::array{way_back});
    reserve(room_.sought, device, blocks.size(), "blocks sought");
    reserve(room_.sought_back, device, blocks.size(), "blocks found");
    reserve(room_.looks, device, blocks.size() * places, "costs of first looks");
    reserve(room_.walks, device, blocks.size(), "walks");
    reserve(room_.walks_back, device, blocks.size(), "walks back");
    room_.sought->upload(blocks);
    const GpuBlocks there{{"MatchSearch", &there_},
                          {"MatchBlocks", &*room_.sought},
                          {"MatchLooks", &*room_.looks},
                          {"MatchWalks", &*room_.walks},
                          {"MatchBack", &*room_.sought_back}};
    const GpuBlocks back{{"MatchSearch", &back_},
                         {"MatchBlocks", &*room_.sought_back},
                         {"MatchLooks", &*room_.looks},
                         {"MatchWalks", &*room_.walks_back},
                         {"MatchBack", &*room_.sought}};
    run(MatchPass::Look, blocks.size() * places, search, there);
    const auto workgroup = static_cast<std::size_t>(matching_.program(MatchPass::Walk).workgroup_size());
    run(MatchPass::Walk, blocks.size() * workgroup, search, there);
    run(MatchPass::Walk, blocks.size() * workgroup, home, back);
    shaders::flush();
    room_.look_bytes = blocks.size() * places * sizeof(float);
    room_.walk_bytes = blocks.size() * sizeof(MatchWalk);
}

GpuBlockEngine::Sights GpuBlockEngine::found() {
    const shaders::CurrentContext current = matching_.device().make_current();
    const auto found = matching_.fetch(std::array{shaders::Readback::Piece{*room_.looks, room_.look_bytes},
                                                  shaders::Readback::Piece{*room_.walks, room_.walk_bytes},
                                                  shaders::Readback::Piece{*room_.walks_back, room_.walk_bytes}});
    return {found[0], found[1], found[2]};
}

void GpuBlockEngine::run(MatchPass pass, std::size_t invocations, const Search& search, const GpuBlocks& own) {
    const GpuBlocks images{{"MatchShownWords", &search.shown.words},
                           {"MatchShownSeen", &search.shown.shown},
                           {"MatchLookedWords", &search.looked.words},
                           {"MatchLookedSeen", &search.looked.shown}};
    matching_.run(pass, invocations, {&images, &own});
}

void GpuBlockEngine::Sights::read(std::size_t n, const Voxel& centre, int reach, BlockSight& sight) const {
    const auto side = static_cast<std::size_t>(2 * reach + 1), places = side * side * side;
    sight.first.centre = centre;
    sight.first.reach = reach;
    sight.first.costs.resize(places);
    for (std::size_t place = 0; place < places; ++place)
        sight.first.costs[place] = as_cost(entry<float>(looks, n * places + place));
    read_walk(entry<MatchWalk>(walks, n), sight.forward);
    read_walk(entry<MatchWalk>(back, n), sight.back);
}

}  // namespace tissuewarp::registration::detail
