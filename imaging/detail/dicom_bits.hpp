#pragma once
/// Packed bytes and bits of DICOM (PS3.5, annexes A.5, D and G).

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace tissuewarp::imaging::detail {

/// Bits from the least significant on, frames joined without padding, into bytes of 0 and 1. False where bytes are too
/// few.
bool unpack_bits(std::string_view bytes, std::uint64_t count, std::uint8_t* target);

/// One frame of RLE: its segments are the bytes of every value, the most significant first. Values of `bytes_per_value`
/// bytes, little endian; as much of it as is sound.
std::string unpack_rle(std::string_view frame, std::size_t bytes_per_value);

/// A raw deflate stream; as much of it as is sound.
std::string unpack_deflated(std::string_view packed);

/// Columns and rows that a frame of JPEG, JPEG-LS or JPEG 2000 states; nothing where it does not begin as one.
std::optional<std::array<std::uint32_t, 2>> packed_frame_size(std::string_view frame);

}  // namespace tissuewarp::imaging::detail
