#pragma once
/// The checksum of OpenIGTLink's message bodies: CRC-64 of ECMA-182 (polynomial 0x42F0E1EBA9EA3693), most significant
/// bit first, starting from 0, without a final exclusive or.

#include <cstdint>
#include <span>

namespace tissuewarp::server {

/// Of more bytes behind those whose checksum is `so_far`.
std::uint64_t crc64(std::span<const unsigned char> bytes, std::uint64_t so_far = 0);

}  // namespace tissuewarp::server
