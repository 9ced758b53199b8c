#pragma once
/// The inner loop of block matching: squared differences of bytes over rows of a block, on the CPU's vector units.

#include <cstddef>
#include <cstdint>

namespace tissuewarp::registration::detail {

/// Bytes that may be read beyond the end of a row.
constexpr int row_padding = 32;

/// Most voxels in a row: their masks have one bit each in a word.
constexpr int most_row_voxels = 64;

/// What a row shows.
enum class RowKind : std::uint8_t { Nothing, Part, Whole };

/// Rows of voxels in memory, ordered (k, j), some bytes to each voxel. Bit n of a row's `seen` says whether voxel n of
/// it counts. The mask has the layout of the values and is looked at in rows of kind Part alone: 255 where a byte
/// counts, 0 where it does not and in the `row_padding` bytes behind the row.
struct VoxelRows {
    const std::uint8_t* value = nullptr;
    const std::uint8_t* mask = nullptr;
    const RowKind* kind = nullptr;
    const std::uint64_t* seen = nullptr;
    int first = 0;                  ///< voxel of the rows that value and mask point to
    std::ptrdiff_t row_bytes = 0;   ///< from one row to the next
    std::ptrdiff_t slice_rows = 0;  ///< from one slice to the next
};

/// Which rows of a block are compared: first, first + stride, … of its `side` rows along j and k; and at how many
/// shifts of the block along its rows, voxel by voxel.
struct RowComparison {
    int side = 0, first = 0, stride = 1, shifts = 1;
    int voxel_bytes = 12;
};

/// For each shift s, over the voxels x that count in the block and at x + s in the window: differences[s] =
/// Σ (block[x] − window[x + s])² over their bytes, voxels[s] their number. Rows may go on beyond the block
/// and the last shift; Whole ones are so all along. Sums are of 32 bits before they are gathered: up to 21 voxels of 12
/// bytes to a side.
void squared_differences(const VoxelRows& block, const VoxelRows& window, const RowComparison& comparison,
                         std::int64_t* differences, std::int64_t* voxels);

}  // namespace tissuewarp::registration::detail
