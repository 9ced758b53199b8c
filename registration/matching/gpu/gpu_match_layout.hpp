#pragma once
/// The arrays that the kernels of image matching read (contracts in shaders/chunks/match*.glsl,
/// shaders/kernels/match_*.comp).

#include "meshing/tet_mesh.hpp"
#include "registration/field/gpu_words.hpp"
#include "registration/field/growth.hpp"
#include "registration/matching/dense/dense_cells.hpp"
#include "registration/matching/descriptors/matching_image.hpp"

#include <Eigen/Geometry>

#include <optional>
#include <span>

namespace tissuewarp::registration::detail {

/// The storage block MatchGrid.
struct MatchGridBlock {
    Uint4 wide_size, fixed_size, cell_count;
    std::array<Float4, 3> to_fixed_index, shift_to_index;
};
MatchGridBlock match_grid_block(const imaging::Geometry& wide, const imaging::Geometry& fixed,
                                const std::array<int, 3>& cells, const Eigen::Isometry3d& placement);

/// An entry of the storage block MatchElements.
struct MatchElement {
    Uint4 nodes;
    Float4 corner;
    std::array<Float4, 3> gradient;
};
std::vector<MatchElement> elements_of(const meshing::TetMesh& mesh, const imaging::Geometry& wide);

/// An entry of the storage block MatchCells: DescriptorProducts, voxels, their places in the cell.
using MatchCell = std::array<std::int32_t, 25>;
/// Of a cell's sums, those that are spread: all but the places.
constexpr std::size_t spread_sums = 22;

/// An entry of the storage block MatchForces, along the axes of the grid.
struct MatchForce {
    std::int32_t voxels;                 ///< that count; where there are none the rest says nothing
    std::array<std::int32_t, 3> places;  ///< their sum, in the cell
    std::int32_t alike, structure;       ///< Σ g₁·g₂ and Σ |g₁|² + |g₂|², g twice the central differences
    std::uint32_t said;                  ///< 1 where there is a force
    std::array<float, 3> shift;          ///< voxels
    std::array<float, 9> root;           ///< 1/voxel: three vectors r, the information is Σ r rᵀ
};
static_assert(sizeof(MatchForce) == 76);
/// `first` is the voxel of the grid that the cell begins with.
std::optional<DenseForce> force_of(const MatchForce& cell, const Voxel& first, const imaging::Geometry& grid);

/// What does not change with the state, of a mesh at rest on a working grid and its rim.
struct MatchLayout {
    imaging::Geometry wide;
    std::vector<std::uint32_t> owner;                  ///< element of each voxel of `wide`, 0xffffffff outside
    std::vector<GrownVoxel> growth;                    ///< layers about the mesh, one after the other
    std::vector<std::array<std::uint32_t, 2>> layers;  ///< first and count of each
    std::vector<std::uint32_t> counts;                 ///< of each voxel of the grid: in the mesh, and shown with its
                                                       ///< six neighbours
};
MatchLayout match_layout(const meshing::TetMesh& mesh, const MatchingImage& moving);

/// Its descriptors, three words a voxel.
std::span<const std::byte> words_of(const MatchingImage& image);

}  // namespace tissuewarp::registration::detail
