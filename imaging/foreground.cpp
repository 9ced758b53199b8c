#include "imaging/foreground.hpp"

#include "core/errors.hpp"
#include "imaging/filters.hpp"
#include "imaging/labels.hpp"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>
#include <vector>

namespace tissuewarp::imaging {

namespace {

[[noreturn]] void refuse(const std::string& why) {
    throw InvalidInput("no organ stands out of the background by itself: " + why);
}

std::string percent(double share) {
    std::ostringstream text;
    text.precision(3);
    text << 100 * share << " %";
    return text.str();
}

struct Range {
    float lower, upper;
};

/// Without the outermost thousandth at either end: a bright spot of metal would take all of the histogram.
Range robust_range(const Volume& image) {
    std::vector<float> values(image.data<float>(), image.data<float>() + image.geometry.voxel_count());
    const auto value_at = [&](double share) {
        const auto place = values.begin() + static_cast<std::ptrdiff_t>(share * double(values.size() - 1));
        std::nth_element(values.begin(), place, values.end());
        return *place;
    };
    return {value_at(0.001), value_at(0.999)};
}

struct Bright {
    Volume mask;
    double threshold;
};

Bright bright_voxels(const Volume& image) {
    const auto [lower, upper] = robust_range(image);
    if (!(upper > lower)) refuse("the image is constant");
    const double step = (double(upper) - lower) / 255;
    cv::Mat bytes;
    image.voxels.reshape(1, 1).convertTo(bytes, CV_8U, 1 / step, -lower / step);
    cv::Mat mask;
    const double level = cv::threshold(bytes, mask, 0, 1, cv::THRESH_BINARY | cv::THRESH_OTSU);
    const std::array<int, 3> sizes{image.geometry.size[2], image.geometry.size[1], image.geometry.size[0]};
    return {Volume(image.geometry, mask.reshape(1, 3, sizes.data())), lower + (level + 0.5) * step};
}

double share_of(const Volume& mask) {
    return cv::countNonZero(mask.voxels.reshape(1, 1)) / double(mask.geometry.voxel_count());
}

void require_body(const Volume& body, const Volume& bright, const ForegroundOptions& options) {
    const double share = share_of(body), of_bright = share_of(largest_component(bright)) / share_of(bright);
    if (share > options.most_of_image) refuse(percent(share) + " of the image is bright");
    if (share < options.least_of_image) refuse("its largest bright piece is " + percent(share) + " of the image");
    if (of_bright < options.least_of_bright)
        refuse("the largest bright piece is " + percent(of_bright) + " of what is bright");
    const double reach_mm = 1.01 * body.geometry.spacing.maxCoeff();
    const double outside = 1 - share_of(erode(body, reach_mm)) / share;
    if (outside > options.most_of_voxels_outside)
        refuse(percent(outside) + " of what is bright lies at its surface, as noise does");
}

/// Of a piece that the edge of the image cuts.
bool at_edge(const Geometry& grid, int i, int j, int k) {
    return i == 0 || j == 0 || k == 0 || i + 1 == grid.size[0] || j + 1 == grid.size[1] || k + 1 == grid.size[2];
}

template <class Visit>
void for_each_voxel(const Geometry& grid, const Visit& visit) {
    std::int64_t n = 0;
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i) visit(n++, i, j, k);
}

}  // namespace

Volume without_holes(const Volume& mask) {
    cv::Mat dark;
    cv::compare(mask.voxels, 0, dark, cv::CMP_EQ);
    const Volume pieces = connected_components(Volume(mask.geometry, dark));
    const auto* piece = pieces.data<std::int32_t>();
    std::set<int> open;
    for_each_voxel(mask.geometry, [&](std::int64_t n, int i, int j, int k) {
        if (piece[n] != 0 && at_edge(mask.geometry, i, j, k)) open.insert(piece[n]);
    });
    Volume filled(mask.geometry, CV_8U);
    auto* values = filled.data<std::uint8_t>();
    for_each_voxel(mask.geometry, [&](std::int64_t n, int, int, int) { values[n] = !open.contains(piece[n]); });
    return filled;
}

Foreground foreground(const Volume& image, const ForegroundOptions& options) {
    if (image.empty() || image.channels() != 1) throw InvalidInput("foreground: give an image of one component");
    const Bright bright = bright_voxels(smooth(image, options.smoothing_mm));
    const Volume body = without_holes(largest_component(bright.mask));
    require_body(body, bright.mask, options);
    const double share = share_of(body);
    return {body.as(CV_32S), bright.threshold,
            share * double(image.geometry.voxel_count()) * image.geometry.voxel_volume(), share};
}

}  // namespace tissuewarp::imaging
