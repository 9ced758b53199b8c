#pragma once
/// Frames of OpenIGTLink: the header in front of every message, big endian, and the bytes behind it. Versions 1 (of
/// protocols 1 and 2) and 2 (of protocol 3, with an extended header and metadata) are read, version 1 is written.

#include "core/errors.hpp"

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace tissuewarp::server {

using Bytes = std::vector<unsigned char>;
using ByteView = std::span<const unsigned char>;

inline constexpr std::size_t header_bytes = 58;

struct Header {
    int version = 1;
    std::string type;             ///< "POINT", "IMAGE", …; at most 12 bytes
    std::string device;           ///< the sender's name for it; at most 20 bytes
    std::uint64_t timestamp = 0;  ///< seconds in the upper 32 bits, their fraction in the lower
    std::uint64_t body_bytes = 0;
    std::uint64_t crc = 0;  ///< of the body
};

/// By the sender's clock, of the years since 1970; 0: it does not say.
inline double seconds_of(const Header& header) {
    return double(header.timestamp) / 4294967296.0;
}

/// Of a header, from seconds of the years since 1970.
inline std::uint64_t timestamp_of(double seconds) {
    return static_cast<std::uint64_t>(seconds * 4294967296.0);
}

/// Of the years since 1970.
double now_s();

/// One message, header and body.
struct Frame {
    Header header;
    Bytes body;
};

/// A message that is none: whoever sent it lost the thread, and is told by the end of the connection.
struct BadMessage : InvalidInput {
    using InvalidInput::InvalidInput;
};

/// The most that a client may send, checked before memory is set aside for it.
struct Limits {
    std::uint64_t text_bytes = 1 << 16;               ///< of a STRING or STATUS
    std::uint64_t points = 100'000;                   ///< of a POINT message
    std::uint64_t mesh_bytes = 64ull << 20;           ///< of a POLYDATA
    std::uint64_t image_bytes = 1ull << 30;           ///< of an IMAGE: 512 × 512 × 2048 voxels of 16 bits
    std::uint64_t unknown_bytes = 1ull << 20;         ///< of a message of another type, which is passed over
    std::uint64_t metadata_bytes = 1 << 16;           ///< of version 2, beside the content
    std::uint64_t bytes_in_flight = 2ull << 30;       ///< of all clients together, not yet taken in
    double messages_per_second = 1000, burst = 2000;  ///< of one client; beyond it its messages wait
    double silence_s = 20;                            ///< within a message: then its sender is let go
    std::size_t clients = 32;
    std::size_t waiting_messages = 256;  ///< for one client that does not read: then it is let go
};

/// Throws BadMessage for a header of another version, with names that are no text, or that promises more than the
/// limits of its type.
Header parse_header(ByteView bytes, const Limits& limits);

/// The content of a body: what lies between the extended header and the metadata of version 2. Throws BadMessage.
ByteView content_of(const Header& header, ByteView body);

/// Header and body of version 1, checksum included. Names are cut to what the header holds.
Bytes framed(std::string_view type, std::string_view device, ByteView body, std::uint64_t timestamp = 0);

/// Reads big-endian numbers and never past the end. Throws BadMessage.
class Reader {
public:
    explicit Reader(ByteView bytes) : rest_(bytes) {}
    [[nodiscard]] std::size_t left() const { return rest_.size(); }
    ByteView take(std::size_t count);
    std::uint8_t u8() { return take(1)[0]; }
    std::uint16_t u16();
    std::uint32_t u32();
    std::uint64_t u64();
    float f32();
    /// A field of fixed length, up to its first zero byte.
    std::string text(std::size_t length);

private:
    ByteView rest_;
};

class Writer {
public:
    void u8(std::uint8_t value) { bytes_.push_back(value); }
    void u16(std::uint16_t value);
    void u32(std::uint32_t value);
    void u64(std::uint64_t value);
    void f32(double value);
    void text(std::string_view value, std::size_t length);
    void raw(ByteView more) { bytes_.insert(bytes_.end(), more.begin(), more.end()); }
    [[nodiscard]] const Bytes& bytes() const { return bytes_; }
    Bytes& bytes() { return bytes_; }

private:
    Bytes bytes_;
};

}  // namespace tissuewarp::server
