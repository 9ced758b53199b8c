#include "registration/detail/gpu_block_engine.hpp"

#include "core/errors.hpp"
#include "registration/detail/grid_samples.hpp"

#include <tbb/parallel_for.h>

#include <cstring>
#include <limits>
#include <numeric>

namespace tissuewarp::registration::detail {

using shaders::MatchPass;

namespace {

static_assert(shaders::match_walk_steps == most_walk_steps);

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

/// Looks first, walks on from the candidates, and walks back.
class GpuFixedBlocks : public FixedBlocks {
public:
    GpuFixedBlocks(GpuBlockEngine& engine, const shaders::Device& device, const DescribedOnDevice& moving,
                   const DescribedOnDevice& fixed)
        : engine_(engine), device_(device), moving_(moving), fixed_(fixed) {}

    void look(const std::vector<SoughtBlock>& blocks, int reach, double least_share, const Visit& visit) override {
        std::vector<BlockSight> sights = looked_at({moving_, fixed_, reach, least_share}, blocks);
        walk_back({fixed_, moving_, 0, least_share}, blocks, sights);
        tbb::parallel_for(std::size_t{0}, sights.size(), [&](std::size_t n) { visit(n, sights[n]); });
    }

private:
    GpuBlockEngine& engine_;
    const shaders::Device& device_;
    DescribedOnDevice moving_, fixed_;

    std::vector<BlockSight> looked_at(const GpuBlockEngine::Search& search, const std::vector<SoughtBlock>& blocks) {
        const shaders::CurrentContext current = device_.make_current();
        std::vector<MatchSoughtBlock> sought;
        for (const SoughtBlock& block : blocks) sought.push_back({packed4(block.moving), packed4(block.fixed)});
        GpuBlockEngine::Lattices looks = engine_.look(search, sought);
        std::vector<std::vector<std::size_t>> places(blocks.size());
        tbb::parallel_for(std::size_t{0}, blocks.size(), [&](std::size_t n) { places[n] = candidates(looks[n]); });
        std::vector<std::uint32_t> all;
        for (std::size_t n = 0; n < blocks.size(); ++n) {
            sought[n].shown[3] = static_cast<std::int32_t>(all.size());
            sought[n].looked[3] = static_cast<std::int32_t>(places[n].size());
            for (const std::size_t place : places[n]) all.push_back(static_cast<std::uint32_t>(place));
        }
        auto walks = engine_.walk(search, sought, all);
        std::vector<BlockSight> sights(blocks.size());
        for (std::size_t n = 0; n < blocks.size(); ++n)
            sights[n] = {std::move(looks[n]), std::move(walks[n]), std::nullopt};
        return sights;
    }

    /// Of the blocks that were found.
    void walk_back(const GpuBlockEngine::Search& search, const std::vector<SoughtBlock>& blocks,
                   std::vector<BlockSight>& sights) {
        const shaders::CurrentContext current = device_.make_current();
        std::vector<std::size_t> found;
        std::vector<MatchSoughtBlock> sought;
        for (std::size_t n = 0; n < blocks.size(); ++n) {
            if (!sights[n].forward) continue;
            found.push_back(n);
            sought.push_back({packed4(sights[n].forward->centre), packed4(blocks[n].moving, 1)});
        }
        auto walks = engine_.walk(search, sought, std::array<std::uint32_t, 1>{0});  // from the place itself
        for (std::size_t n = 0; n < found.size(); ++n) sights[found[n]].back = std::move(walks[n]);
    }
};

}  // namespace

GpuBlockEngine::GpuBlockEngine(MatchDevice& matching, std::vector<DescribedOnDevice> moving, int block_radius)
    : matching_(matching),
      moving_(std::move(moving)),
      fixed_(moving_.size()),
      radius_(block_radius),
      search_(matching.device(), 1, "search for blocks") {
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
    return std::make_unique<GpuFixedBlocks>(*this, matching_.device(), moving_[level],
                                            DescribedOnDevice{grid, *words, *shown});
}

void GpuBlockEngine::upload(const Search& search, std::span<const MatchSoughtBlock> blocks) {
    const auto least = [&](int stride) {
        return static_cast<float>(least_voxels(radius_, stride, search.least_share));
    };
    search_.upload(
        std::array{MatchSearchBlock{packed4(search.shown.grid.size), packed4(search.looked.grid.size), radius_,
                                    search.reach, first_look_stride, first_row(radius_, first_look_stride),
                                    least(first_look_stride), least(1), static_cast<std::uint32_t>(blocks.size()), 0}});
    reserve(sought_, matching_.device(), blocks.size(), "blocks sought");
    sought_->upload(blocks);
}

GpuBlocks GpuBlockEngine::blocks_of(const Search& search) const {
    return {{"MatchSearch", &search_},
            {"MatchBlocks", &*sought_},
            {"MatchShownWords", &search.shown.words},
            {"MatchShownSeen", &search.shown.shown},
            {"MatchLookedWords", &search.looked.words},
            {"MatchLookedSeen", &search.looked.shown}};
}

GpuBlockEngine::Lattices GpuBlockEngine::look(const Search& search, std::span<const MatchSoughtBlock> blocks) {
    constexpr std::size_t most_costs = 16U << 20U;  // in one go
    const auto side = static_cast<std::size_t>(2 * search.reach + 1), places = side * side * side;
    const std::size_t batch = std::max<std::size_t>(1, most_costs / places);
    Lattices result(blocks.size());
    for (std::size_t first = 0; first < blocks.size(); first += batch) {
        const auto some = blocks.subspan(first, std::min(batch, blocks.size() - first));
        upload(search, some);
        reserve(looks_, matching_.device(), some.size() * places, "costs of first looks");
        GpuBlocks own = blocks_of(search);
        own["MatchLooks"] = &*looks_;
        matching_.run(MatchPass::Look, some.size() * places, {&own});
        const auto bytes = matching_.fetch(*looks_, some.size() * places * sizeof(float));
        tbb::parallel_for(std::size_t{0}, some.size(), [&](std::size_t n) {
            const auto& centre = some[n].looked;
            CostLattice& lattice = result[first + n];
            lattice = {{centre[0], centre[1], centre[2]}, search.reach, std::vector<double>(places)};
            for (std::size_t place = 0; place < places; ++place)
                lattice.costs[place] = as_cost(entry<float>(bytes, n * places + place));
        });
    }
    return result;
}

std::vector<std::optional<CostLattice>> GpuBlockEngine::walk(const Search& search,
                                                             std::span<const MatchSoughtBlock> blocks,
                                                             std::span<const std::uint32_t> candidates) {
    std::vector<std::optional<CostLattice>> result(blocks.size());
    if (blocks.empty()) return result;
    upload(search, blocks);
    reserve(candidates_, matching_.device(), candidates.size(), "candidates");
    candidates_->upload(candidates);
    reserve(walks_, matching_.device(), blocks.size(), "walks");
    GpuBlocks own = blocks_of(search);
    own["MatchCandidates"] = &*candidates_;
    own["MatchWalks"] = &*walks_;
    const auto workgroup = static_cast<std::size_t>(matching_.program(MatchPass::Walk).workgroup_size());
    matching_.run(MatchPass::Walk, blocks.size() * workgroup, {&own});
    const auto bytes = matching_.fetch(*walks_, blocks.size() * sizeof(MatchWalk));
    tbb::parallel_for(std::size_t{0}, blocks.size(), [&](std::size_t n) {
        const auto walk = entry<MatchWalk>(bytes, n);
        if (walk.end[3] == 0) return;
        CostLattice near{{walk.end[0], walk.end[1], walk.end[2]}, 1, std::vector<double>(27)};
        std::transform(walk.costs.begin(), walk.costs.begin() + 27, near.costs.begin(), as_cost);
        result[n] = std::move(near);
    });
    return result;
}

}  // namespace tissuewarp::registration::detail
