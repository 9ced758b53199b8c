#pragma once
/// Pictures as the bytes of a file.

#include <opencv2/core.hpp>

#include <string>
#include <vector>

namespace tissuewarp::report::detail {

/// A PNG of a picture of three bytes a pixel (blue, green, red). Throws InvalidInput for any other type, IoError without
/// memory.
std::vector<unsigned char> png(const cv::Mat& picture);

/// The same as a JPEG; `quality` from 1 to 100.
std::vector<unsigned char> jpeg(const cv::Mat& picture, int quality);

/// Base64 (RFC 4648) of bytes.
std::string base64(const std::vector<unsigned char>& bytes);

}  // namespace tissuewarp::report::detail
