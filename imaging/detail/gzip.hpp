#pragma once
/// Deflate streams: parallel compression, and verification that a stream is whole.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

namespace tissuewarp::imaging::detail {

/// Fills `target` with bytes [first, first + count) of what is compressed; asked by several threads at once, for pieces
/// of 1 MiB from the beginning on.
using ByteSource = std::function<void(std::uint64_t first, std::uint64_t count, unsigned char* target)>;

/// Compresses `size` bytes into the gzip file `destination`: one member, made of blocks that are deflated in parallel
/// and joined at byte boundaries (as pigz does), so that every reader takes it. The bytes do not depend on the number
/// of threads. Throws IoError when the disk is full or the file cannot be opened.
void write_gzip(const ByteSource& source, std::uint64_t size, const std::filesystem::path& destination);

/// True when a file begins as gzip files do, whatever its name says.
bool is_gzip(const std::filesystem::path& path);

/// Part of an unpacked stream.
struct UnpackedRange {
    std::uint64_t skip = 0;   ///< bytes before it
    std::uint64_t count = 0;  ///< bytes of it
};

/// Unpacks the gzip or zlib stream at `offset` of a file to its end, so that checksums are verified, and keeps one
/// range of it in `target` (nothing when null). Returns the number of bytes behind `range.skip`: `range.count` when the
/// stream holds just that; reading stops early once it is more. Throws IoError on a stream that is cut short or
/// damaged.
std::uint64_t inflate(const std::filesystem::path& path, std::uint64_t offset, const UnpackedRange& range,
                      char* target);

/// Reads up to `count` first bytes of a file, unpacked when it is gzip. Throws IoError.
std::string read_head(const std::filesystem::path& path, std::size_t count);

}  // namespace tissuewarp::imaging::detail
