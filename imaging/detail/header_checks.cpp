#include "imaging/detail/header_checks.hpp"

#include "core/file_message.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <sstream>

namespace tissuewarp::imaging::detail {
namespace fs = std::filesystem;

namespace {

/// OpenCV counts in int. 2^31 values are 8 GB of float32, beyond any patient's image.
constexpr double most_values = 2147483647.0;

}  // namespace

InvalidInput unusable(const fs::path& path, const std::string& cause) {
    return InvalidInput(presentable("cannot use '" + path.string() + "': " + cause));
}

IoError unreadable(const fs::path& path, const std::string& cause) {
    return IoError(presentable("cannot read '" + path.string() + "': " + cause));
}

std::string shortened(const std::string& text) {
    constexpr std::size_t longest = 200;
    return text.size() <= longest ? text : text.substr(0, longest) + "…";
}

std::string all_digits(double value) {
    std::array<char, 32> text{};
    return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr};
}

std::string text_of(const std::vector<double>& sizes) {
    std::ostringstream text;
    for (std::size_t i = 0; i < sizes.size(); ++i) text << (i ? " x " : "") << sizes[i];
    return text.str();
}

std::uint64_t values_of(const fs::path& path, const std::vector<double>& sizes) {
    double product = 1.0;
    for (const double size : sizes) {
        if (!(size >= 1.0) || size != std::floor(size))
            throw unusable(path,
                           "its size " + text_of(sizes) + " is not of positive whole numbers; correct the header");
        product *= size;
    }
    if (product > most_values)
        throw unusable(path, "its header promises " + text_of(sizes) + " values, limit " +
                                 std::to_string(static_cast<long long>(most_values)) + "; the header is damaged");
    return static_cast<std::uint64_t>(product);
}

void require_spacing(const fs::path& path, double spacing, std::size_t axis) {
    if (std::isfinite(spacing) && spacing != 0.0) return;
    std::ostringstream value;
    value << spacing;
    throw unusable(path, "its spacing along axis " + std::to_string(axis) + " is " + value.str() +
                             " mm; write the true voxel size into the header");
}

void require_three_dimensions(const fs::path& path, const std::vector<double>& sizes) {
    const bool flat = sizes.size() < 3 || *std::min_element(sizes.begin(), sizes.begin() + 3) == 1.0;
    if (flat)
        throw unusable(path,
                       "its size " + text_of(sizes) + " is a two-dimensional image; give a volume of three dimensions");
}

}  // namespace tissuewarp::imaging::detail
