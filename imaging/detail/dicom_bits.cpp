#include "imaging/detail/dicom_bits.hpp"

#include <zlib.h>

#include <algorithm>
#include <vector>

namespace tissuewarp::imaging::detail {

namespace {

/// PackBits, as TIFF has it.
std::string unpack_run_lengths(std::string_view packed) {
    std::string plain;
    for (std::size_t at = 0; at + 1 < packed.size();) {
        const int count = static_cast<signed char>(packed[at++]);
        if (count >= 0) {
            const std::size_t length = std::min<std::size_t>(static_cast<std::size_t>(count) + 1, packed.size() - at);
            plain.append(packed.substr(at, length));
            at += length;
        } else if (count != -128) {
            plain.append(static_cast<std::size_t>(1 - count), packed[at++]);
        }
    }
    return plain;
}

}  // namespace

bool unpack_bits(std::string_view bytes, std::uint64_t count, std::uint8_t* target) {
    if (8 * bytes.size() < count) return false;
    for (std::uint64_t i = 0; i < count; ++i)
        target[i] = static_cast<std::uint8_t>(static_cast<unsigned char>(bytes[i / 8]) >> i % 8 & 1U);
    return true;
}

std::string unpack_rle(std::string_view frame, std::size_t bytes_per_value) {
    constexpr std::size_t header_bytes = 64;  // the number of segments and 15 offsets, uint32 little endian
    if (frame.size() < header_bytes) return "";
    const auto word = [&](std::size_t index) {
        std::size_t value = 0;
        for (std::size_t i = 0; i < 4; ++i)
            value |= std::size_t{static_cast<unsigned char>(frame[4 * index + i])} << 8 * i;
        return value;
    };
    if (word(0) != bytes_per_value) return "";
    std::vector<std::string> planes;
    std::size_t least = ~std::size_t{0};
    for (std::size_t s = 0; s < bytes_per_value; ++s) {
        const std::size_t begin = std::min(word(s + 1), frame.size());
        const std::size_t end = s + 1 < bytes_per_value ? std::min(word(s + 2), frame.size()) : frame.size();
        planes.push_back(unpack_run_lengths(frame.substr(begin, end > begin ? end - begin : 0)));
        least = std::min(least, planes.back().size());
    }
    std::string values(least * bytes_per_value, '\0');
    for (std::size_t s = 0; s < bytes_per_value; ++s)
        for (std::size_t i = 0; i < least; ++i) values[i * bytes_per_value + (bytes_per_value - 1 - s)] = planes[s][i];
    return values;
}

std::string unpack_deflated(std::string_view packed) {
    std::string plain;
    z_stream stream{};
    if (inflateInit2(&stream, -MAX_WBITS) != Z_OK) return plain;
    std::string in(packed), out(std::size_t{1} << 18, '\0');
    stream.next_in = reinterpret_cast<Bytef*>(in.data());
    stream.avail_in = static_cast<uInt>(in.size());
    int status = Z_OK;
    while (status == Z_OK) {
        stream.next_out = reinterpret_cast<Bytef*>(out.data());
        stream.avail_out = static_cast<uInt>(out.size());
        status = inflate(&stream, Z_NO_FLUSH);
        plain.append(out, 0, out.size() - stream.avail_out);
    }
    inflateEnd(&stream);
    return plain;
}

std::optional<std::array<std::uint32_t, 2>> packed_frame_size(std::string_view frame) {
    const auto number = [&](std::size_t at, int bytes) {  // big endian, 0 behind the end
        std::uint32_t value = 0;
        for (; bytes > 0; --bytes, ++at)
            value = value << 8U | (at < frame.size() ? static_cast<unsigned char>(frame[at]) : 0U);
        return value;
    };
    if (number(0, 4) == 0xff4fff51U) return std::array{number(8, 4) - number(16, 4), number(12, 4) - number(20, 4)};
    if (number(0, 2) != 0xffd8U) return std::nullopt;
    for (std::size_t at = 2; number(at, 1) == 0xffU; at += 2 + number(at + 2, 2)) {
        const std::uint32_t marker = number(at, 2);
        const bool tables = marker == 0xffc4U || marker == 0xffc8U || marker == 0xffccU;
        if ((marker >= 0xffc0U && marker <= 0xffcfU && !tables) || marker == 0xfff7U)
            return std::array{number(at + 7, 2), number(at + 5, 2)};
    }
    return std::nullopt;
}

}  // namespace tissuewarp::imaging::detail
