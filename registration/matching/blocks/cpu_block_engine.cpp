#include "registration/matching/blocks/block_cost.hpp"
#include "registration/matching/blocks/block_engine.hpp"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <limits>

namespace tissuewarp::registration::detail {

namespace {

/// The lowest candidate by all rows of the block. Along an edge many places are nearly as low, and the one that a few
/// rows prefer is no minimum of all of them.
std::optional<Voxel> lowest_of_candidates(BlockCosts& costs, const CostLattice& first) {
    const std::vector<std::size_t> places = candidates(first);
    if (places.size() == 1) return first.place(places.front());
    std::optional<Voxel> lowest;
    double least = std::numeric_limits<double>::infinity();
    for (const std::size_t n : places) {
        const Voxel place = first.place(n);
        const double cost = costs.lattice(place, 0, 1).costs[0];
        if (cost < least) lowest = place;
        least = std::min(least, cost);
    }
    return lowest;
}

/// Walks from a place to the lowest of its 27 until that is itself. Returns the costs about it.
std::optional<CostLattice> descend(BlockCosts& costs, Voxel at) {
    for (int step = 0; step < most_walk_steps; ++step) {
        const CostLattice near = costs.lattice(at, 1, 1);
        const auto lowest = near.lowest();
        if (!lowest) return std::nullopt;
        if (!(near.cost(*lowest) < near.cost(at))) return near;
        at = *lowest;
    }
    return std::nullopt;
}

/// Memory of a thread.
struct Windows {
    BlockWindow moving, fixed;
};

class CpuFixedBlocks : public FixedBlocks {
public:
    CpuFixedBlocks(const MatchingImage& moving, MatchingImage fixed, int radius)
        : moving_(moving), fixed_(std::move(fixed)), radius_(radius) {}

    void look(const std::vector<SoughtBlock>& blocks, int reach, double least_share, const Visit& visit,
              const std::function<void()>& meanwhile) override {
        meanwhile();
        tbb::enumerable_thread_specific<Windows> windows;
        tbb::parallel_for(std::size_t{0}, blocks.size(), [&](std::size_t n) {
            visit(n, sight({blocks[n].moving, radius_, least_share}, blocks[n].fixed, reach, windows.local()));
        });
    }

private:
    const MatchingImage& moving_;
    MatchingImage fixed_;
    int radius_;

    [[nodiscard]] BlockSight sight(const Block& block, const Voxel& expected, int reach, Windows& windows) const {
        Surroundings here(moving_, block.centre, block.radius + back_reach, windows.moving),
            there(fixed_, expected, block.radius + reach + 1, windows.fixed);
        BlockCosts forward(here, there, block);
        BlockSight sight{forward.lattice(expected, reach, first_look_stride), {}, {}};
        const auto lowest = lowest_of_candidates(forward, sight.first);
        if (!lowest) return sight;
        sight.forward = descend(forward, *lowest);
        if (!sight.forward) return sight;
        BlockCosts backward(there, here, {sight.forward->centre, block.radius, block.least_share});
        sight.back = descend(backward, block.centre);
        return sight;
    }
};

class CpuBlockEngine : public BlockEngine {
public:
    CpuBlockEngine(const TemplateImages& moving, const SeenImage& fixed) : moving_(moving), fixed_(fixed) {}

    std::unique_ptr<FixedBlocks> fixed_on(const imaging::Geometry& grid, const SearchRegion& region,
                                          std::size_t level) override {
        return std::make_unique<CpuFixedBlocks>(moving_.levels.at(level),
                                                matching_image(fixed_.image, fixed_.seen, grid, region),
                                                moving_.options.block_radius);
    }

private:
    const TemplateImages& moving_;
    const SeenImage& fixed_;
};

}  // namespace

std::vector<std::size_t> candidates(const CostLattice& first) {
    const auto adjoin = [&](std::size_t n, std::size_t other) {
        const Voxel a = first.displacement(n), b = first.displacement(other);
        return std::abs(a[0] - b[0]) <= 1 && std::abs(a[1] - b[1]) <= 1 && std::abs(a[2] - b[2]) <= 1;
    };
    std::vector<std::pair<double, std::size_t>> ranked;
    ranked.reserve(first.costs.size());
    for (std::size_t n = 0; n < first.costs.size(); ++n)
        if (std::isfinite(first.costs[n])) ranked.emplace_back(first.costs[n], n);
    const std::size_t count = std::min(ranked.size(), 1 + first.costs.size() / candidates_one_of);
    std::partial_sort(ranked.begin(), ranked.begin() + static_cast<std::ptrdiff_t>(count), ranked.end());
    std::vector<std::size_t> result;
    for (std::size_t n = 0; n < count && result.size() < most_candidates; ++n) {
        const std::size_t place = ranked[n].second;
        if (std::none_of(result.begin(), result.end(), [&](std::size_t other) { return adjoin(place, other); }))
            result.push_back(place);
    }
    return result;
}

std::unique_ptr<BlockEngine> make_cpu_block_engine(const TemplateImages& moving, const SeenImage& fixed) {
    return std::make_unique<CpuBlockEngine>(moving, fixed);
}

}  // namespace tissuewarp::registration::detail
