#include "imaging/detail/dicom_bits.hpp"

#include <algorithm>
#include <cstring>

namespace tissuewarp::imaging::detail {

bool unpack_bits(const std::string& bytes, std::uint64_t first, std::uint64_t count, std::uint8_t* target) {
    if (8 * bytes.size() < first + count) return false;
    for (std::uint64_t i = 0; i < count; ++i) {
        const std::uint64_t bit = first + i;
        target[i] = static_cast<std::uint8_t>(static_cast<unsigned char>(bytes[bit / 8]) >> bit % 8 & 1U);
    }
    return true;
}

std::string unpack_rle(const std::string& frame) {
    constexpr std::size_t header_bytes = 64;  // the number of segments and 15 offsets, uint32 little endian
    if (frame.size() < header_bytes) return "";
    const auto word = [&](std::size_t index) {
        std::uint32_t value = 0;
        for (std::size_t i = 0; i < 4; ++i)
            value |= std::uint32_t{static_cast<unsigned char>(frame[4 * index + i])} << 8 * i;
        return value;
    };
    const std::size_t end = word(0) > 1 ? std::min<std::size_t>(word(2), frame.size()) : frame.size();
    std::string plain;
    for (std::size_t at = std::max<std::size_t>(word(1), header_bytes); at + 1 < end;) {
        const int count = static_cast<signed char>(frame[at++]);
        if (count >= 0) {
            const std::size_t length = std::min<std::size_t>(static_cast<std::size_t>(count) + 1, end - at);
            plain.append(frame, at, length);
            at += length;
        } else if (count != -128) {
            plain.append(static_cast<std::size_t>(1 - count), frame[at++]);
        }
    }
    return plain;
}

}  // namespace tissuewarp::imaging::detail
