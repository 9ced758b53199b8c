#pragma once
/// Pixels of one bit, as segmentations have them (DICOM PS3.5, annexes D and G).

#include <cstdint>
#include <string>

namespace tissuewarp::imaging::detail {

/// Bits from the least significant on, frames joined without padding, into bytes of 0 and 1. False where bytes are too
/// few.
bool unpack_bits(const std::string& bytes, std::uint64_t first, std::uint64_t count, std::uint8_t* target);

/// The first segment of an RLE frame, unpacked; as much of it as is sound.
std::string unpack_rle(const std::string& frame);

}  // namespace tissuewarp::imaging::detail
