#pragma once
/// Block matching in shaders.

#include "registration/detail/block_engine.hpp"
#include "registration/detail/match_device.hpp"

namespace tissuewarp::registration::detail {

/// What the kernels read of a search and of its blocks (contracts in shaders/chunks/match.block.glsl).
struct MatchSearchBlock {
    std::array<std::int32_t, 4> shown_size, looked_size;
    std::int32_t block_radius, reach, look_stride, look_first;
    float look_least, walk_least;
    std::uint32_t block_count, unused;
};
struct MatchSoughtBlock {
    std::array<std::int32_t, 4> shown, looked;
};
struct MatchWalk {
    std::array<std::int32_t, 4> end;
    std::array<float, 28> costs;
};

class GpuBlockEngine : public BlockEngine {
public:
    /// `moving` are the levels of the template. Throws GpuUnavailable where a block's sums would not fit.
    GpuBlockEngine(MatchDevice& matching, std::vector<DescribedOnDevice> moving, int block_radius);

    std::unique_ptr<FixedBlocks> fixed_on(const imaging::Geometry& grid, const SearchRegion& region,
                                          std::size_t level) override;

    /// Of blocks that one image shows and another is looked at for: first looks of each; and where walks end.
    struct Search {
        DescribedOnDevice shown, looked;
        int reach;
        double least_share;
    };
    using Lattices = std::vector<CostLattice>;
    [[nodiscard]] Lattices look(const Search& search, std::span<const MatchSoughtBlock> blocks);
    /// `candidates` are entries of lattices, to which the blocks refer.
    [[nodiscard]] std::vector<std::optional<CostLattice>> walk(const Search& search,
                                                               std::span<const MatchSoughtBlock> blocks,
                                                               std::span<const std::uint32_t> candidates);

private:
    struct Described {
        std::optional<GpuWords> words, shown;
    };

    MatchDevice& matching_;
    std::vector<DescribedOnDevice> moving_;
    std::vector<Described> fixed_;  // of each level
    int radius_;
    shaders::Buffer<MatchSearchBlock> search_;
    std::optional<shaders::Buffer<MatchSoughtBlock>> sought_;
    std::optional<GpuFloats> looks_;
    std::optional<GpuWords> candidates_;
    std::optional<shaders::Buffer<MatchWalk>> walks_;

    void upload(const Search& search, std::span<const MatchSoughtBlock> blocks);
    [[nodiscard]] GpuBlocks blocks_of(const Search& search) const;
};

}  // namespace tissuewarp::registration::detail
