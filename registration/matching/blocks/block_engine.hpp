#pragma once
/// Where blocks of the moving image are compared with places of the fixed one: on the processor, or in shaders.

#include "registration/matching/blocks/cost_lattice.hpp"
#include "registration/matching/points/template_images.hpp"

#include <functional>
#include <memory>
#include <optional>

namespace tissuewarp::registration::detail {

/// A block, and where it is expected: voxels of the moving and of the fixed grid.
struct SoughtBlock {
    Voxel moving{0, 0, 0}, fixed{0, 0, 0};
};

/// The costs that a search for a block met.
struct BlockSight {
    CostLattice first;                   ///< about the place expected, of every third row of the block
    std::optional<CostLattice> forward;  ///< the 27 about the lowest place downhill of the first look's; none where the
                                         ///< walk left what is seen, or did not end
    std::optional<CostLattice> back;     ///< the same of the way back: the block about `forward`, walking in the moving
                                         ///< image from where the first block lies
};

/// A fixed image made ready on a grid.
class FixedBlocks {
public:
    using Visit = std::function<void(std::size_t, const BlockSight&)>;

    virtual ~FixedBlocks() = default;

    /// Looks for blocks within `reach` voxels along each axis of where they are expected. Calls visit(n, sight) once
    /// for each, from any thread. A cost counts where both images show `least_share` of the block's voxels.
    /// `meanwhile` is called once on the caller's thread: where a device searches, while it does.
    virtual void look(
        const std::vector<SoughtBlock>& blocks, int reach, double least_share, const Visit& visit,
        const std::function<void()>& meanwhile = [] {}) = 0;
};

class BlockEngine {
public:
    virtual ~BlockEngine() = default;

    /// The fixed image on a grid with the spacing of a level of the template, described in a region of it at least.
    /// What is returned serves until the next one of that level, and does not outlive the engine.
    virtual std::unique_ptr<FixedBlocks> fixed_on(const imaging::Geometry& grid, const SearchRegion& region,
                                                  std::size_t level) = 0;
};

/// Template and image outlive the engine.
std::unique_ptr<BlockEngine> make_cpu_block_engine(const TemplateImages& moving, const SeenImage& fixed);

/// How a block is looked for. Chosen by hand; on which data is not recorded. Shaders have the same numbers.
struct BlockLookOptions {
    int first_stride = 3;                ///< every third row of a block, over the whole lattice
    std::size_t most_candidates = 27;    ///< of a first look, to be compared by all rows
    std::size_t candidates_one_of = 20;  ///< places: all candidates are among these, the lowest
    int walk_steps = 8;                  ///< downhill at most, one voxel along each axis at a time
};
inline constexpr BlockLookOptions block_look_options{};
constexpr int first_look_stride = block_look_options.first_stride;
constexpr std::size_t most_candidates = block_look_options.most_candidates,
                      candidates_one_of = block_look_options.candidates_one_of;

/// The places that a first look puts lowest, one of those that adjoin, the lowest first; entries of the lattice.
std::vector<std::size_t> candidates(const CostLattice& first);

constexpr int most_walk_steps = block_look_options.walk_steps;

}  // namespace tissuewarp::registration::detail
