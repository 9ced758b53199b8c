#pragma once
/// The inner loop of block matching: squared differences of bytes over rows of a block, on the CPU's vector units.

#include <cstddef>
#include <cstdint>

namespace tissuewarp::registration::detail {

/// Bytes that may be read beyond the end of a row.
constexpr int row_padding = 64;

/// Rows of bytes in memory, ordered (k, j), with a mask of the same layout: 255 where a byte counts and 0 where it does
/// not. `row_padding` bytes behind each row can be read.
struct ByteRows {
    const std::uint8_t* value = nullptr;
    const std::uint8_t* mask = nullptr;
    std::ptrdiff_t row = 0, slice = 0;  ///< bytes from one to the next
};

/// Which rows of a block are compared: `count` along j and k, every `stride`-th of them, `bytes` long; and how many
/// shifts of the block along its rows, `step` bytes apart.
struct RowComparison {
    int count = 0, stride = 1, bytes = 0;
    int shifts = 1, step = 1;
};

/// For each shift s: differences[s] = Σ (block[x] − window[x + s step])² over the block's bytes. The mask of the block
/// is 255 in its rows and 0 behind them; that of the window is not looked at. Σ over one 32-bit lane must not overflow:
/// up to 21 rows of 252 bytes along j and k.
void whole_squared_differences(const ByteRows& block, const ByteRows& window, const RowComparison& comparison,
                               std::int64_t* differences);

/// The same where both masks are 255; and counts[s] = 255² times the number of bytes that are.
void masked_squared_differences(const ByteRows& block, const ByteRows& window, const RowComparison& comparison,
                                std::int64_t* differences, std::int64_t* counts);

}  // namespace tissuewarp::registration::detail
