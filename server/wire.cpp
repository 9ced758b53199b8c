#include "server/wire.hpp"

#include "server/crc64.hpp"

#include <algorithm>
#include <bit>
#include <chrono>

namespace tissuewarp::server {

namespace {

constexpr std::size_t type_bytes = 12, device_bytes = 20, extended_bytes = 12, point_bytes = 136;

bool is_printable(const std::string& text) {
    return std::all_of(text.begin(), text.end(), [](unsigned char c) { return c >= 0x20 && c != 0x7f; });
}

std::uint64_t most_bytes(const std::string& type, const Limits& limits) {
    if (type == "IMAGE") return limits.image_bytes;
    if (type == "POLYDATA") return limits.mesh_bytes;
    if (type == "POINT") return limits.points * point_bytes;
    if (type == "STRING" || type == "STATUS") return limits.text_bytes + 64;
    if (type == "TRANSFORM") return 48;
    return limits.unknown_bytes;
}

template <class T>
T big_endian(ByteView bytes) {
    T value = 0;
    for (const unsigned char byte : bytes) value = static_cast<T>(static_cast<std::uint64_t>(value) << 8 | byte);
    return value;
}

template <class T>
void append(Bytes& bytes, T value) {
    for (int shift = 8 * (int(sizeof(T)) - 1); shift >= 0; shift -= 8)
        bytes.push_back(static_cast<unsigned char>(value >> shift));
}

}  // namespace

ByteView Reader::take(std::size_t count) {
    if (count > rest_.size())
        throw BadMessage("it ends " + std::to_string(count - rest_.size()) + " bytes before its numbers do");
    const ByteView taken = rest_.first(count);
    rest_ = rest_.subspan(count);
    return taken;
}
std::uint16_t Reader::u16() {
    return big_endian<std::uint16_t>(take(2));
}
std::uint32_t Reader::u32() {
    return big_endian<std::uint32_t>(take(4));
}
std::uint64_t Reader::u64() {
    return big_endian<std::uint64_t>(take(8));
}
float Reader::f32() {
    return std::bit_cast<float>(u32());
}
std::string Reader::text(std::size_t length) {
    const ByteView field = take(length);
    return {field.begin(), std::find(field.begin(), field.end(), 0)};
}

void Writer::u16(std::uint16_t value) {
    append(bytes_, value);
}
void Writer::u32(std::uint32_t value) {
    append(bytes_, value);
}
void Writer::u64(std::uint64_t value) {
    append(bytes_, value);
}
void Writer::f32(double value) {
    u32(std::bit_cast<std::uint32_t>(static_cast<float>(value)));
}
void Writer::text(std::string_view value, std::size_t length) {
    value = value.substr(0, length);
    bytes_.insert(bytes_.end(), value.begin(), value.end());
    bytes_.insert(bytes_.end(), length - value.size(), 0);
}

Header parse_header(ByteView bytes, const Limits& limits) {
    Reader reader(bytes);
    Header header;
    header.version = reader.u16();
    header.type = reader.text(type_bytes);
    header.device = reader.text(device_bytes);
    header.timestamp = reader.u64();
    header.body_bytes = reader.u64();
    header.crc = reader.u64();
    if (header.version < 1 || header.version > 2)
        throw BadMessage("its header has version " + std::to_string(header.version) + "; known are 1 and 2");
    if (header.type.empty() || !is_printable(header.type) || !is_printable(header.device))
        throw BadMessage("its header names no type of message");
    const std::uint64_t most =
        most_bytes(header.type, limits) + (header.version == 2 ? extended_bytes + limits.metadata_bytes : 0);
    if (header.body_bytes > most)
        throw BadMessage("a message " + header.type + " of " + std::to_string(header.body_bytes) +
                         " bytes is too long; the most is " + std::to_string(most));
    return header;
}

ByteView content_of(const Header& header, ByteView body) {
    if (header.version == 1) return body;
    Reader reader(body);
    const std::size_t extended = reader.u16(), metadata_header = reader.u16(), metadata = reader.u32();
    if (extended < extended_bytes || extended + metadata_header + metadata > body.size())
        throw BadMessage("its extended header and metadata are longer than the message");
    return body.subspan(extended, body.size() - extended - metadata_header - metadata);
}

double now_s() {
    return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

Bytes framed(std::string_view type, std::string_view device, ByteView body, std::uint64_t timestamp) {
    Writer writer;
    writer.bytes().reserve(header_bytes + body.size());
    writer.u16(1);
    writer.text(type, type_bytes);
    writer.text(device, device_bytes);
    writer.u64(timestamp);
    writer.u64(body.size());
    writer.u64(crc64(body));
    writer.raw(body);
    return std::move(writer.bytes());
}

}  // namespace tissuewarp::server
