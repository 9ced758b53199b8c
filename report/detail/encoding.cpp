// By libpng and TurboJPEG themselves: OpenCV's imgcodecs needs GDAL, and with it 130 packages that a registration has
// no use for (docs/decisions/packages.md).
#include "report/detail/encoding.hpp"

#include "core/errors.hpp"

#include <png.h>
#include <turbojpeg.h>

#include <algorithm>
#include <memory>
#include <string>

namespace tissuewarp::report::detail {

namespace {

void require_colour(const cv::Mat& picture) {
    if (picture.type() != CV_8UC3 || picture.empty())
        throw InvalidInput("a picture to encode has three bytes a pixel and one pixel at least");
}

}  // namespace

std::vector<unsigned char> png(const cv::Mat& picture) {
    require_colour(picture);
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = static_cast<png_uint_32>(picture.cols);
    image.height = static_cast<png_uint_32>(picture.rows);
    image.format = PNG_FORMAT_BGR;
    const auto stride = static_cast<png_int_32>(picture.step[0]);
    png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
    std::vector<unsigned char> bytes(size);
    if (!png_image_write_to_memory(&image, bytes.data(), &size, 0, picture.data, stride, nullptr))
        throw IoError(std::string("a picture cannot be encoded as PNG: ") + image.message);
    bytes.resize(size);
    return bytes;
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
