#pragma once
/// Deflate streams: parallel compression of a file, and verification that a stream is whole.

#include <cstdint>
#include <filesystem>
#include <string>

namespace tissuewarp::imaging::detail {

/// Compresses `source` into the gzip file `destination`: one member, made of blocks that are deflated in parallel and
/// joined at byte boundaries (as pigz does), so that every reader takes it. The bytes do not depend on the number of
/// threads. `level` is zlib's, 1 (fast) to 9. Throws IoError when the disk is full or a file cannot be opened.
void gzip_file(const std::filesystem::path& source, const std::filesystem::path& destination, int level);

/// Number of bytes that the gzip or zlib stream at `offset` of a file unpacks to; checksums are verified. Stops early
/// and returns a larger number once more than `limit` bytes have come out. Throws IoError on a stream that is cut short
/// or damaged.
std::uint64_t inflated_size(const std::filesystem::path& path, std::uint64_t offset, std::uint64_t limit);

/// Reads up to `count` first bytes of a file, unpacked when it is gzip. Throws IoError.
std::string read_head(const std::filesystem::path& path, std::size_t count);

}  // namespace tissuewarp::imaging::detail
