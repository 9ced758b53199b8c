#include "imaging/detail/gzip.hpp"

#include "core/errors.hpp"

#include <tbb/parallel_for.h>
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

/// Raw deflate of one block. All but the last end in a sync flush, which pads to a whole byte so that blocks can be
/// joined into one stream.
void deflate_block(Block& block, int level) {
    z_stream stream{};
    if (deflateInit2(&stream, level, Z_DEFLATED, -MAX_WBITS, 9, Z_DEFAULT_STRATEGY) != Z_OK)
        throw IoError("zlib cannot start: out of memory");
    // The sync flush adds an empty stored block, at most 10 bytes beyond the bound of the data itself.
    block.packed.resize(deflateBound(&stream, static_cast<uLong>(block.plain.size())) + 16);
    stream.next_in = block.plain.data();
    stream.avail_in = static_cast<uInt>(block.plain.size());
    stream.next_out = block.packed.data();
    stream.avail_out = static_cast<uInt>(block.packed.size());
    const int status = deflate(&stream, block.last ? Z_FINISH : Z_SYNC_FLUSH);
    const bool complete = (status == Z_OK || status == Z_STREAM_END) && stream.avail_in == 0 && stream.avail_out > 0;
    block.packed.resize(stream.total_out);
    deflateEnd(&stream);
    if (!complete) throw IoError("zlib cannot compress a block of " + std::to_string(block.plain.size()) + " bytes");
    block.checksum = crc32(0, block.plain.data(), static_cast<uInt>(block.plain.size()));
}

void put_little_endian(std::FILE* file, std::uint32_t value, const fs::path& path) {
    const std::array<unsigned char, 4> bytes{static_cast<unsigned char>(value), static_cast<unsigned char>(value >> 8),
                                             static_cast<unsigned char>(value >> 16),
                                             static_cast<unsigned char>(value >> 24)};
    put(file, bytes.data(), bytes.size(), path);
}

}  // namespace

void gzip_file(const fs::path& source, const fs::path& destination, int level) {
    constexpr std::size_t block_bytes = std::size_t{1} << 20;
    constexpr std::size_t blocks_at_once = 16;  // bounds memory to about 33 MB
    const File in = open_file(source, "rb");
    File out = open_file(destination, "wb");
    // RFC 1952: magic, deflate, no flags, no time (the same image gives the same file), no hint, unknown system.
    constexpr std::array<unsigned char, 10> header{0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 255};
    put(out.get(), header.data(), header.size(), destination);

    uLong checksum = crc32(0, nullptr, 0);
    std::uint64_t total = 0;
    const std::uint64_t expected = fs::file_size(source);
    for (bool finished = false; !finished;) {
        std::vector<Block> blocks;
        while (blocks.size() < blocks_at_once && !finished) {
            Block block;
            block.plain.resize(block_bytes);
            block.plain.resize(std::fread(block.plain.data(), 1, block_bytes, in.get()));
            total += block.plain.size();
            finished = block.last = block.plain.size() < block_bytes || total == expected;
            blocks.push_back(std::move(block));
        }
        tbb::parallel_for(std::size_t{0}, blocks.size(), [&](std::size_t i) { deflate_block(blocks[i], level); });
        for (const Block& block : blocks) {
            put(out.get(), block.packed.data(), block.packed.size(), destination);
            checksum = crc32_combine(checksum, block.checksum, static_cast<z_off_t>(block.plain.size()));
        }
    }
    if (total != expected) throw IoError("cannot read back '" + source.string() + "'");
    put_little_endian(out.get(), static_cast<std::uint32_t>(checksum), destination);
    put_little_endian(out.get(), static_cast<std::uint32_t>(total), destination);
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
