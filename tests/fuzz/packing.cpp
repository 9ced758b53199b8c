#include "tests/fuzz/format.hpp"

#include <zlib.h>

#include <fstream>
#include <iterator>
#include <stdexcept>

namespace tissuewarp::fuzz {

namespace {

int window_bits(Packing packing) {
    if (packing == Packing::Gzip) return MAX_WBITS + 16;
    return packing == Packing::Zlib ? MAX_WBITS : -MAX_WBITS;
}

std::string packed(std::string bytes, Packing packing) {
    z_stream stream{};
    if (deflateInit2(&stream, 6, Z_DEFLATED, window_bits(packing), 8, Z_DEFAULT_STRATEGY) != Z_OK)
        throw std::runtime_error("zlib cannot start");
    std::string result(deflateBound(&stream, bytes.size()) + 64, '\0');
    stream.next_in = reinterpret_cast<Bytef*>(bytes.data());
    stream.avail_in = static_cast<uInt>(bytes.size());
    stream.next_out = reinterpret_cast<Bytef*>(result.data());
    stream.avail_out = static_cast<uInt>(result.size());
    deflate(&stream, Z_FINISH);
    result.resize(stream.total_out);
    deflateEnd(&stream);
    return result;
}

}  // namespace

std::string bytes_of(const SeedFile& file) {
    return file.head + (file.packing == Packing::None ? file.body : packed(file.body, file.packing));
}

Seed single(const std::string& name, std::string bytes) {
    return {{{name, {std::move(bytes), "", Packing::None}}}, name};
}

std::string bytes_at(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace tissuewarp::fuzz
