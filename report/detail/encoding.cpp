// PNG by libdeflate, which takes a third of libpng's time, and JPEG by TurboJPEG: OpenCV's imgcodecs needs GDAL, and
// with it 130 packages that a registration has no use for (docs/decisions/packages.md). PNG: ISO/IEC 15948:2004.
#include "report/detail/encoding.hpp"

#include "core/errors.hpp"

#include <libdeflate.h>
#include <turbojpeg.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <memory>
#include <string>

namespace tissuewarp::report::detail {

namespace {

void require_colour(const cv::Mat& picture) {
    if (picture.type() != CV_8UC3 || picture.empty())
        throw InvalidInput("a picture to encode has three bytes a pixel and one pixel at least");
}

using Bytes = std::vector<unsigned char>;
constexpr std::size_t pixel_bytes = 3;

unsigned char paeth(int left, int above, int corner) {
    const int estimate = left + above - corner;
    const int to_left = std::abs(estimate - left), to_above = std::abs(estimate - above),
              to_corner = std::abs(estimate - corner);
    if (to_left <= to_above && to_left <= to_corner) return static_cast<unsigned char>(left);
    return static_cast<unsigned char>(to_above <= to_corner ? above : corner);
}

/// What filter `type` leaves of a row under the one above it: PNG, 9.2.
void filter_row(int type, const Bytes& row, const Bytes& above, unsigned char* target) {
    const std::size_t count = row.size();
    const auto each = [&](const auto& predicted) {
        for (std::size_t n = 0; n < pixel_bytes; ++n)
            target[n] = static_cast<unsigned char>(row[n] - predicted(0, above[n], 0));
        for (std::size_t n = pixel_bytes; n < count; ++n)
            target[n] =
                static_cast<unsigned char>(row[n] - predicted(row[n - pixel_bytes], above[n], above[n - pixel_bytes]));
    };
    if (type == 0) each([](int, int, int) { return 0; });
    if (type == 1) each([](int left, int, int) { return left; });
    if (type == 2) each([](int, int up, int) { return up; });
    if (type == 3) each([](int left, int up, int) { return (left + up) / 2; });
    if (type == 4) each([](int left, int up, int corner) { return int{paeth(left, up, corner)}; });
}

/// Of the filtered bytes as signed numbers, which tells how well they pack: PNG, 12.8.
long sum_of_sizes(const unsigned char* bytes, std::size_t count) {
    long sum = 0;
    for (std::size_t n = 0; n < count; ++n) sum += bytes[n] < 128 ? bytes[n] : 256 - bytes[n];
    return sum;
}

/// Every row behind the number of its filter.
Bytes filtered(const cv::Mat& picture) {
    constexpr int filters = 5;
    const std::size_t width = pixel_bytes * static_cast<std::size_t>(picture.cols);
    Bytes result, row(width), above(width, 0), tried(width), best(width);
    result.reserve((width + 1) * static_cast<std::size_t>(picture.rows));
    for (int y = 0; y < picture.rows; ++y, above.swap(row)) {
        const auto* pixels = picture.ptr<cv::Vec3b>(y);
        for (std::size_t x = 0; x < width / pixel_bytes; ++x)
            for (std::size_t c = 0; c < pixel_bytes; ++c)
                row[pixel_bytes * x + c] = pixels[x][static_cast<int>(2 - c)];  // BGR
        long least = std::numeric_limits<long>::max();
        int chosen = 0;
        for (int type = 0; type < filters; ++type) {
            filter_row(type, row, above, tried.data());
            const long sum = sum_of_sizes(tried.data(), width);
            if (sum >= least) continue;
            least = sum;
            chosen = type;
            best.swap(tried);
        }
        result.push_back(static_cast<unsigned char>(chosen));
        result.insert(result.end(), best.begin(), best.end());
    }
    return result;
}

struct FreeCompressor {
    void operator()(libdeflate_compressor* compressor) const { libdeflate_free_compressor(compressor); }
};

Bytes packed(const Bytes& bytes) {
    constexpr int level = 6;  // of libdeflate
    const std::unique_ptr<libdeflate_compressor, FreeCompressor> compressor(libdeflate_alloc_compressor(level));
    if (!compressor) throw IoError("a picture cannot be encoded as PNG: out of memory");
    Bytes result(libdeflate_zlib_compress_bound(compressor.get(), bytes.size()));
    result.resize(libdeflate_zlib_compress(compressor.get(), bytes.data(), bytes.size(), result.data(), result.size()));
    return result;
}

void append_number(Bytes& file, std::uint32_t number) {
    for (const int shift : {24, 16, 8, 0}) file.push_back(static_cast<unsigned char>(number >> shift));
}

void append_chunk(Bytes& file, const char* name, const Bytes& content) {
    append_number(file, static_cast<std::uint32_t>(content.size()));
    const std::size_t begin = file.size();
    file.insert(file.end(), name, name + 4);
    file.insert(file.end(), content.begin(), content.end());
    append_number(file, libdeflate_crc32(0, &file[begin], file.size() - begin));
}

}  // namespace

std::vector<unsigned char> png(const cv::Mat& picture) {
    require_colour(picture);
    Bytes file{0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'}, header;
    append_number(header, static_cast<std::uint32_t>(picture.cols));
    append_number(header, static_cast<std::uint32_t>(picture.rows));
    header.insert(header.end(), {8, 2, 0, 0, 0});  // bits of a channel, RGB, deflate, those five filters, no interlace
    append_chunk(file, "IHDR", header);
    append_chunk(file, "IDAT", packed(filtered(picture)));
    append_chunk(file, "IEND", {});
    return file;
}

std::vector<unsigned char> jpeg(const cv::Mat& picture, int quality) {
    require_colour(picture);
    const std::unique_ptr<void, int (*)(tjhandle)> encoder(tjInitCompress(), tjDestroy);
    const int columns = picture.cols, rows = picture.rows;
    std::vector<unsigned char> bytes(tjBufSize(columns, rows, TJSAMP_420));
    unsigned char* at = bytes.data();
    unsigned long size = bytes.size();
    if (tjCompress2(encoder.get(), picture.data, columns, static_cast<int>(picture.step[0]), rows, TJPF_BGR, &at, &size,
                    TJSAMP_420, quality, TJFLAG_NOREALLOC) != 0)
        throw IoError(std::string("a picture cannot be encoded as JPEG: ") + tjGetErrorStr2(encoder.get()));
    bytes.resize(size);
    return bytes;
}

std::string base64(const std::vector<unsigned char>& bytes) {
    static constexpr char alphabet[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string result;
    result.reserve((bytes.size() + 2) / 3 * 4);
    for (std::size_t at = 0; at < bytes.size(); at += 3) {
        const std::size_t left = std::min<std::size_t>(3, bytes.size() - at);
        unsigned group = 0;
        for (std::size_t k = 0; k < 3; ++k) group = group << 8 | (k < left ? bytes[at + k] : 0u);
        for (std::size_t k = 0; k < 4; ++k) result += k <= left ? alphabet[group >> (18 - 6 * k) & 63] : '=';
    }
    return result;
}

}  // namespace tissuewarp::report::detail
