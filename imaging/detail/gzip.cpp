#include "imaging/detail/gzip.hpp"

#include "core/errors.hpp"

#include <libdeflate.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <vector>

namespace tissuewarp::imaging::detail {
namespace fs = std::filesystem;

namespace {

/// libdeflate's. Of quantised fields it makes smaller files than zlib's level 4 in a fifth of the time
/// (docs/decisions/transforms_out.md); levels 2 to 6 take twice to five times as long for 15 % less at the most.
constexpr int level = 1;

struct CloseFile {
    void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

File open_file(const fs::path& path, const char* mode) {
    File file(std::fopen(path.c_str(), mode));
    if (!file)
        throw IoError("cannot open '" + path.string() + "': " + std::strerror(errno) +
                      "; check the path and its rights");
    return file;
}

void put(std::FILE* file, const void* bytes, std::size_t count, const fs::path& path) {
    if (count != 0 && std::fwrite(bytes, 1, count, file) != count)
        throw IoError("cannot write '" + path.string() + "': " + std::strerror(errno) + "; free space on the disk");
}

struct Block {
    std::vector<unsigned char> plain, packed;
    uLong checksum = 0;
    bool last = false;
};

/// Of raw deflate, bits from its start.
struct LastBlock {
    std::uint64_t begin = 0, end = 0;
};

/// libdeflate does not say where the last block of its stream lies, so zlib reads the stream as far. `plain` is room
/// for what it unpacks.
LastBlock last_block(const std::vector<unsigned char>& packed, std::vector<unsigned char>& plain) {
    constexpr int unused_bits = 7, in_last = 64, at_boundary = 128;  // of data_type, zlib.h
    z_stream stream{};
    if (inflateInit2(&stream, -MAX_WBITS) != Z_OK) throw IoError("zlib cannot start: out of memory");
    const std::unique_ptr<z_stream, int (*)(z_stream*)> ends(&stream, inflateEnd);
    stream.next_in = const_cast<unsigned char*>(packed.data());
    stream.avail_in = static_cast<uInt>(packed.size());
    stream.next_out = plain.data();
    stream.avail_out = static_cast<uInt>(plain.size());
    LastBlock result;
    while (::inflate(&stream, Z_BLOCK) == Z_OK) {
        if (!(stream.data_type & at_boundary)) continue;
        const std::uint64_t here = 8 * std::uint64_t{stream.total_in} - (stream.data_type & unused_bits);
        if (stream.data_type & in_last) {
            result.end = here;
            return result;
        }
        result.begin = here;
    }
    throw IoError("libdeflate made a stream that zlib cannot read");
}

/// Makes the last block one of many, and pads with an empty stored block to a whole byte (RFC 1951, 3.2.4), so that
/// another stream can follow.
void open_end(std::vector<unsigned char>& packed, const LastBlock& last) {
    packed[last.begin / 8] &= static_cast<unsigned char>(~(1U << last.begin % 8));
    const std::uint64_t header_end = last.end + 3;  // its three bits are zero, as the padding is
    packed.resize((header_end + 7) / 8, 0);
    packed.insert(packed.end(), {0x00, 0x00, 0xff, 0xff});
}

struct FreeCompressor {
    void operator()(libdeflate_compressor* compressor) const { libdeflate_free_compressor(compressor); }
};

/// Raw deflate of one block. All but the last can be followed by another.
void deflate_block(Block& block) {
    const std::unique_ptr<libdeflate_compressor, FreeCompressor> compressor(libdeflate_alloc_compressor(level));
    if (!compressor) throw IoError("libdeflate cannot start: out of memory");
    block.packed.resize(libdeflate_deflate_compress_bound(compressor.get(), block.plain.size()));
    block.packed.resize(libdeflate_deflate_compress(compressor.get(), block.plain.data(), block.plain.size(),
                                                    block.packed.data(), block.packed.size()));
    if (block.packed.empty())
        throw IoError("libdeflate cannot compress a block of " + std::to_string(block.plain.size()) + " bytes");
    block.checksum = libdeflate_crc32(0, block.plain.data(), block.plain.size());
    if (block.last) return;
    open_end(block.packed, last_block(block.packed, block.plain));
}

void put_little_endian(std::FILE* file, std::uint32_t value, const fs::path& path) {
    const std::array<unsigned char, 4> bytes{static_cast<unsigned char>(value), static_cast<unsigned char>(value >> 8),
                                             static_cast<unsigned char>(value >> 16),
                                             static_cast<unsigned char>(value >> 24)};
    put(file, bytes.data(), bytes.size(), path);
}

}  // namespace

void write_gzip(const ByteSource& source, std::uint64_t size, const fs::path& destination) {
    constexpr std::uint64_t block_bytes = std::uint64_t{1} << 20;
    // Bounds memory to about 4 MB a thread.
    const auto blocks_at_once = 2 * static_cast<std::uint64_t>(tbb::this_task_arena::max_concurrency());
    File out = open_file(destination, "wb");
    // RFC 1952: magic, deflate, no flags, no time (the same image gives the same file), no hint, unknown system.
    constexpr std::array<unsigned char, 10> header{0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 255};
    put(out.get(), header.data(), header.size(), destination);

    uLong checksum = crc32(0, nullptr, 0);
    const std::uint64_t count = std::max<std::uint64_t>(1, (size + block_bytes - 1) / block_bytes);
    for (std::uint64_t first = 0; first < count; first += blocks_at_once) {
        std::vector<Block> blocks(std::min(blocks_at_once, count - first));
        tbb::parallel_for(std::size_t{0}, blocks.size(), [&](std::size_t i) {
            const std::uint64_t begin = (first + i) * block_bytes;
            blocks[i].plain.resize(std::min(block_bytes, size - begin));
            blocks[i].last = first + i + 1 == count;
            source(begin, blocks[i].plain.size(), blocks[i].plain.data());
            deflate_block(blocks[i]);
        });
        for (const Block& block : blocks) {
            put(out.get(), block.packed.data(), block.packed.size(), destination);
            checksum = crc32_combine(checksum, block.checksum, static_cast<z_off_t>(block.plain.size()));
        }
    }
    put_little_endian(out.get(), static_cast<std::uint32_t>(checksum), destination);
    put_little_endian(out.get(), static_cast<std::uint32_t>(size), destination);
    if (std::fflush(out.get()) != 0 || std::fclose(out.release()) != 0)
        throw IoError("cannot write '" + destination.string() + "': " + std::strerror(errno) +
                      "; free space on the disk");
}

bool is_gzip(const fs::path& path) {
    const File in = open_file(path, "rb");
    std::array<unsigned char, 2> magic{};
    return std::fread(magic.data(), 1, 2, in.get()) == 2 && magic[0] == 0x1f && magic[1] == 0x8b;
}

std::uint64_t inflate(const fs::path& path, std::uint64_t offset, const UnpackedRange& range, char* target) {
    const File in = open_file(path, "rb");
    if (std::fseek(in.get(), static_cast<long>(offset), SEEK_SET) != 0)
        throw IoError("'" + path.string() + "' ends before byte " + std::to_string(offset) + "; copy the file again");
    std::vector<unsigned char> packed(std::size_t{1} << 18), plain(std::size_t{1} << 18);
    z_stream stream{};
    if (inflateInit2(&stream, MAX_WBITS + 32) != Z_OK) throw IoError("zlib cannot start: out of memory");
    const std::unique_ptr<z_stream, int (*)(z_stream*)> ends(&stream, inflateEnd);
    const std::uint64_t end = range.skip + range.count;
    std::uint64_t total = 0;
    int status = Z_OK;
    for (;;) {
        if (stream.avail_in == 0) {
            stream.next_in = packed.data();
            stream.avail_in = static_cast<uInt>(std::fread(packed.data(), 1, packed.size(), in.get()));
            if (stream.avail_in == 0) break;
        }
        if (status == Z_STREAM_END) {
            // A gzip file may hold several members; anything else after the end is padding that readers ignore.
            if (stream.avail_in < 2 || stream.next_in[0] != 0x1f || stream.next_in[1] != 0x8b) break;
            inflateReset(&stream);
        }
        stream.next_out = plain.data();
        stream.avail_out = static_cast<uInt>(plain.size());
        status = ::inflate(&stream, Z_NO_FLUSH);
        const std::uint64_t out = plain.size() - stream.avail_out;
        const std::uint64_t from = std::max(total, range.skip), to = std::min(total + out, end);
        if (target != nullptr && from < to)
            std::memcpy(target + (from - range.skip), plain.data() + (from - total), to - from);
        total += out;
        if (total > end) return total - range.skip;
        if (status != Z_OK && status != Z_STREAM_END && status != Z_BUF_ERROR)
            throw IoError("'" + path.string() + "' holds damaged compressed data after " + std::to_string(total) +
                          " bytes (" + (stream.msg ? stream.msg : "zlib error") + "); copy the file again");
    }
    if (status != Z_STREAM_END)
        throw IoError("'" + path.string() + "' is cut short: its compressed data stop after " + std::to_string(total) +
                      " bytes; copy the file again");
    return total > range.skip ? total - range.skip : 0;
}

std::string read_head(const fs::path& path, std::size_t count) {
    const std::unique_ptr<gzFile_s, int (*)(gzFile)> file(gzopen(path.c_str(), "rb"), gzclose);
    if (!file)
        throw IoError("cannot open '" + path.string() + "': " + std::strerror(errno) +
                      "; check the path and its rights");
    std::string head(count, '\0');
    const int got = gzread(file.get(), head.data(), static_cast<unsigned>(count));
    head.resize(static_cast<std::size_t>(std::max(got, 0)));
    return head;
}

}  // namespace tissuewarp::imaging::detail
