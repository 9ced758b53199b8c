#include "meshing/detail/vtk_encoding.hpp"

#include <zlib.h>

#include <algorithm>
#include <cstdint>
#include <cstring>

namespace tissuewarp::meshing::detail {

namespace {

/// 0 to 63; −1 for '=', −2 for a blank, −3 for what is none of base64.
int base64_digit(char c) {
    if (c >= 'A' && c <= 'Z') return c - 'A';
    if (c >= 'a' && c <= 'z') return c - 'a' + 26;
    if (c >= '0' && c <= '9') return c - '0' + 52;
    if (c == '+') return 62;
    if (c == '/') return 63;
    if (c == '=') return -1;
    return c == ' ' || c == '\n' || c == '\r' || c == '\t' ? -2 : -3;
}

/// Decodes base64 to at least `most` bytes, or until a character outside the alphabet. Padding ends a group, not the
/// stream: VTK encodes the lengths and the data of one array as two streams in a row.
std::string decode_base64(std::string_view text, std::uint64_t most, const FileReader& file) {
    std::string bytes;
    std::uint32_t bits = 0;
    int held = 0, padding = 0;
    for (const char c : text) {
        if (bytes.size() >= most) break;
        const int digit = base64_digit(c);
        if (digit == -3) break;
        if (digit == -2) continue;
        padding += digit == -1;
        bits = (bits << 6) | static_cast<std::uint32_t>(std::max(digit, 0));
        if (++held < 4) continue;
        if (padding > 2) file.fail("has damaged base64 data");
        for (int byte = 0; byte < 3 - padding; ++byte) bytes += static_cast<char>(bits >> (16 - 8 * byte));
        bits = 0;
        held = padding = 0;
    }
    return bytes;
}

/// Reads an array from its beginning, as far as it is asked for.
class Beginning {
public:
    Beginning(const VtkEncoded& encoded, const FileReader& file) : encoded_(encoded), file_(file) {}

    /// The first bytes, so many.
    std::string_view first(std::uint64_t count) {
        if (count > encoded_.text.size()) file_.fail("ends before its data do");
        if (!encoded_.base64) return encoded_.text.substr(0, count);
        if (bytes_.size() < count) bytes_ = decode_base64(encoded_.text, count, file_);
        if (bytes_.size() < count) file_.fail("ends before its data do");
        return std::string_view(bytes_).substr(0, count);
    }

    /// The number at this place among lengths. Precondition: `place` is below the size of the file.
    std::uint64_t length(std::uint64_t place) {
        const std::size_t width = encoded_.header_bytes;
        const std::string_view bytes = first((place + 1) * width);
        std::uint64_t value = 0;
        std::memcpy(&value, bytes.data() + place * width, width);
        return value;
    }

private:
    const VtkEncoded& encoded_;
    const FileReader& file_;
    std::string bytes_;
};

std::string uncompressed(const VtkEncoded& encoded, const FileReader& file) {
    Beginning beginning(encoded, file);
    const std::uint64_t length = beginning.length(0);
    if (length > file.text().size()) file.fail("ends before its data do");
    return std::string(beginning.first(encoded.header_bytes + length).substr(encoded.header_bytes));
}

/// Appends what one block holds: exactly `length` bytes.
void inflate(std::string_view block, std::uint64_t length, std::string& bytes, const FileReader& file) {
    if (length > most_compression * (block.size() + 1))
        file.fail("announces a block of " + std::to_string(length) + " bytes, more than " +
                  std::to_string(block.size()) + " compressed ones can hold");
    const std::size_t before = bytes.size();
    bytes.resize(before + length);
    uLongf held = length;
    const int outcome = ::uncompress(reinterpret_cast<Bytef*>(bytes.data() + before), &held,
                                     reinterpret_cast<const Bytef*>(block.data()), block.size());
    if (outcome != Z_OK || held != length) file.fail("has damaged compressed data");
}

/// Number of blocks, length of each, of the last if it is shorter (otherwise 0), compressed lengths, then the blocks.
std::string inflated(const VtkEncoded& encoded, const FileReader& file) {
    Beginning beginning(encoded, file);
    const std::uint64_t blocks = beginning.length(0), size = file.text().size();
    if (blocks == 0) return {};
    if (blocks > size / encoded.header_bytes)
        file.fail("announces " + std::to_string(blocks) + " blocks, more than the file can hold");
    const std::uint64_t whole = beginning.length(1), last = beginning.length(2);
    const std::uint64_t lengths_end = (3 + blocks) * encoded.header_bytes;
    beginning.first(lengths_end);  // at once: base64 is decoded from the beginning every time
    std::uint64_t end = lengths_end;
    for (std::uint64_t b = 0; b < blocks; ++b) {
        if (beginning.length(3 + b) > size - end) file.fail("ends before its data do");
        end += beginning.length(3 + b);
    }
    std::string_view rest = beginning.first(end).substr(lengths_end);
    std::string bytes;
    for (std::uint64_t b = 0; b < blocks; ++b) {
        const std::string_view block = rest.substr(0, beginning.length(3 + b));
        inflate(block, b + 1 == blocks && last > 0 ? last : whole, bytes, file);
        rest.remove_prefix(block.size());
    }
    return bytes;
}

}  // namespace

std::string decoded(const VtkEncoded& encoded, const FileReader& file) {
    return encoded.compressed ? inflated(encoded, file) : uncompressed(encoded, file);
}

}  // namespace tissuewarp::meshing::detail
