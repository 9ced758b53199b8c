#pragma once
/// Block matching in shaders.

#include "registration/matching/blocks/block_engine.hpp"
#include "registration/matching/gpu/match_device.hpp"

namespace tissuewarp::registration::detail {

/// What the kernels read of a search and of its blocks (contracts in shaders/chunks/match.block.glsl).
struct MatchSearchBlock {
    std::array<std::int32_t, 4> shown_size, looked_size;
    std::int32_t block_radius, reach, look_stride, look_first;
    float look_least, walk_least;
    std::uint32_t block_count, is_way_back;
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

    /// Images that show blocks of one and are looked at for them.
    struct Search {
        DescribedOnDevice shown, looked;
        int reach;
        double least_share;
    };
    /// As the device leaves it, until the next search begins: costs of first looks, walks and walks back, block after
    /// block.
    struct Sights {
        std::span<const std::byte> looks, walks, back;

        /// Of a block, `centre` being where it is expected, with first looks of some reach.
        void read(std::size_t n, const Voxel& centre, int reach, BlockSight& sight) const;
    };
    /// Of as many blocks as most_blocks() says.
    void begin_search(const Search& search, std::span<const MatchSoughtBlock> blocks);
    /// Waits for the search that was begun.
    [[nodiscard]] Sights found();
    [[nodiscard]] static std::size_t most_blocks(int reach);

private:
    struct Described {
        std::optional<GpuWords> words, shown;
    };

    /// What a search reads and leaves, and how much of it.
    struct Room {
        std::optional<shaders::Buffer<MatchSoughtBlock>> sought, sought_back;
        std::optional<GpuFloats> looks;
        std::optional<shaders::Buffer<MatchWalk>> walks, walks_back;
        std::size_t look_bytes = 0, walk_bytes = 0;  // of the search begun
    };

    MatchDevice& matching_;
    std::vector<DescribedOnDevice> moving_;
    std::vector<Described> fixed_;  // of each level
    int radius_;
    shaders::Buffer<MatchSearchBlock> there_, back_;
    Room room_;

    [[nodiscard]] MatchSearchBlock parameters(const Search& search, std::size_t blocks) const;
    void run(shaders::MatchPass pass, std::size_t invocations, const Search& search, const GpuBlocks& own);
};

}  // namespace tissuewarp::registration::detail
