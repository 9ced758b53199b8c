#include "report/detail/viewer_volumes.hpp"

#include "report/detail/encoding.hpp"
#include "report/detail/picture.hpp"

#include <tbb/task_group.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

namespace tissuewarp::report::detail {

namespace {

using Eigen::Vector3d;
using imaging::Geometry;
using imaging::Interpolation;
using imaging::Volume;

/// Over the box and a margin, with cubic voxels that are no smaller than `least_mm` and as few as `most`.
Geometry viewer_grid(const Box& organ, double least_mm, double most) {
    constexpr double margin_mm = 14;
    const Vector3d extent = organ.extent() + Vector3d::Constant(2 * margin_mm);
    Geometry grid;
    grid.spacing.setConstant(std::max(least_mm, std::cbrt(extent.prod() / most)));
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto a = static_cast<Eigen::Index>(axis);
        grid.size[axis] = std::max(2, static_cast<int>(extent[a] / grid.spacing[a]));
        grid.origin[a] = organ.centre()[a] - (grid.size[axis] - 1) * grid.spacing[a] / 2;
    }
    return grid;
}

/// Tiles to a row: pictures nearly square.
int columns_of(const Geometry& grid) {
    const double pixels = static_cast<double>(grid.size[2]) * grid.size[1] / grid.size[0];
    return std::clamp(static_cast<int>(std::lround(std::sqrt(pixels))), 1, grid.size[2]);
}

nlohmann::json grid_json(const Geometry& grid) {
    return {{"size", grid.size},
            {"origin", {grid.origin[0], grid.origin[1], grid.origin[2]}},
            {"spacing", grid.spacing[0]},
            {"columns", columns_of(grid)}};
}

/// Slices of a volume of bytes, one channel or three, as tiles.
cv::Mat tiles(const Volume& bytes) {
    const Geometry& grid = bytes.geometry;
    const int columns = columns_of(grid), rows = (grid.size[2] + columns - 1) / columns;
    cv::Mat picture = cv::Mat::zeros(rows * grid.size[1], columns * grid.size[0], bytes.voxels.type());
    for (int k = 0; k < grid.size[2]; ++k) {
        const cv::Mat slice(grid.size[1], grid.size[0], bytes.voxels.type(), const_cast<uchar*>(bytes.voxels.ptr(k)));
        slice.copyTo(
            picture(cv::Rect(k % columns * grid.size[0], k / columns * grid.size[1], grid.size[0], grid.size[1])));
    }
    return picture;
}

/// As a JPEG of 0.8 MB at the most; noise gets less quality.
std::string grey_picture(const Volume& image, const Window& window, const Geometry& grid) {
    constexpr std::size_t most_bytes = 800'000;
    const Volume cut = imaging::resample(image.as(CV_32F), grid, Interpolation::Linear, window.lower);
    Volume bytes(grid, CV_8UC1);
    const double scale = 255 / (window.upper - window.lower);
    cut.voxels.convertTo(bytes.voxels, CV_8U, scale, -window.lower * scale);
    cv::Mat colour;
    const cv::Mat grey = tiles(bytes);
    cv::merge(std::vector<cv::Mat>{grey, grey, grey}, colour);
    std::vector<unsigned char> file;
    for (const int quality : {80, 60, 40, 20, 10}) {
        file = jpeg(colour, quality);
        if (file.size() <= most_bytes) break;
    }
    return "data:image/jpeg;base64," + base64(file);
}

/// Of three volumes, or null, a PNG with one in each of red, green and blue.
std::string byte_picture(const std::array<const Volume*, 3>& channels, const Geometry& grid) {
    const cv::Mat none = tiles(Volume(grid, CV_8UC1));
    std::vector<cv::Mat> blue_green_red;
    for (const int c : {2, 1, 0}) {
        const Volume* channel = channels[static_cast<std::size_t>(c)];
        blue_green_red.push_back(channel == nullptr ? none : tiles(*channel));
    }
    cv::Mat colour;
    cv::merge(blue_green_red, colour);
    return "data:image/png;base64," + base64(png(colour));
}

/// Labels as 1 to 255, in circles where there are more.
Volume label_bytes(const Volume& labels, const Geometry& grid) {
    const Volume cut = imaging::resample(labels.as(CV_32S), grid, Interpolation::Nearest);
    Volume bytes(grid, CV_8UC1);
    const int* from = cut.data<int>();
    std::transform(from, from + grid.voxel_count(), bytes.data<std::uint8_t>(), [](int label) {
        return static_cast<std::uint8_t>(label == 0 ? 0 : 1 + static_cast<unsigned>(label - 1) % 255);
    });
    return bytes;
}

std::string label_picture(const ReportInput& input, const Geometry& grid) {
    std::array<Volume, 3> bytes;
    std::array<const Volume*, 3> channels{};
    const std::array<const Volume*, 3> labels{input.fixed_labels, input.moving_labels, input.warped_labels};
    for (std::size_t c = 0; c < 3; ++c) {
        if (labels[c] == nullptr) continue;
        bytes[c] = label_bytes(*labels[c], grid);
        channels[c] = &bytes[c];
    }
    return byte_picture(channels, grid);
}

std::uint8_t in_255ths(double value, double limit) {
    return std::isfinite(value) ? cv::saturate_cast<std::uint8_t>(255 * value / limit) : std::uint8_t{0};
}

/// How far each place of the fixed frame was moved beyond the rigid alignment, in 255ths of the limit.
Volume displacement_bytes(const ReportInput& input, const Geometry& grid, double limit_mm) {
    const Eigen::Isometry3d alignment = alignment_of(input.report);
    const Volume field = imaging::resample(input.fixed_to_moving->as(CV_32F), grid, Interpolation::Linear);
    Volume bytes(grid, CV_8UC1);
    std::int64_t at = 0;
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i, ++at) {
                const Vector3d place = grid.point(Vector3d(i, j, k));
                const cv::Vec3f& d = field.data<cv::Vec3f>()[at];
                const double moved = (place - alignment * (place + Vector3d(d[0], d[1], d[2]))).norm();
                bytes.data<std::uint8_t>()[at] = in_255ths(moved, limit_mm);
            }
    return bytes;
}

nlohmann::json values(const ReportInput& input, const Geometry& grid, double displacement_mm, double error_mm) {
    nlohmann::json result{{"grid", grid_json(grid)}};
    Volume displacement, error, trust;
    std::array<const Volume*, 3> channels{};
    if (input.fixed_to_moving != nullptr) {
        displacement = displacement_bytes(input, grid, displacement_mm);
        channels[0] = &displacement;
        result["displacement_mm"] = displacement_mm;
    }
    if (input.uncertainty != nullptr) {
        const Volume deviation = imaging::resample(input.uncertainty->as(CV_32F), grid, Interpolation::Nearest);
        error = Volume(grid, CV_8UC1);
        std::transform(deviation.data<float>(), deviation.data<float>() + grid.voxel_count(),
                       error.data<std::uint8_t>(), [&](float value) { return in_255ths(value, error_mm); });
        trust = imaging::resample(input.trust->as(CV_8U), grid, Interpolation::Nearest);
        trust.voxels *= 80;
        channels[1] = &error;
        channels[2] = &trust;
        result["error_mm"] = error_mm;
    }
    result["picture"] = byte_picture(channels, grid);
    return result;
}

}  // namespace

nlohmann::json viewer_volumes(const ReportInput& input, const Box& organ, double displacement_mm, double error_mm) {
    const imaging::Volume& finest = input.fixed != nullptr ? *input.fixed : organ_labels(input);
    const Geometry grid = viewer_grid(organ, finest.geometry.spacing.minCoeff(), most_viewer_voxels);
    const Volume* moving = input.moving != nullptr ? input.moving : input.warped;
    nlohmann::json result{{"grid", grid_json(grid)}};
    std::string labels, fixed, before, after;
    nlohmann::json shown_values;
    tbb::task_group pictures;
    pictures.run([&] { labels = label_picture(input, grid); });
    if (input.fixed != nullptr)
        pictures.run([&] { fixed = grey_picture(*input.fixed, window_of(*input.fixed, organ), grid); });
    if (moving != nullptr)
        pictures.run([&] {
            const std::optional<Box> lay = label_box(*input.moving_labels);
            const Window window = window_of(*moving, input.moving != nullptr && lay ? *lay : organ);
            if (input.moving != nullptr) before = grey_picture(*input.moving, window, grid);
            if (input.warped != nullptr) after = grey_picture(*input.warped, window, grid);
        });
    if (input.fixed_to_moving != nullptr || input.uncertainty != nullptr)
        pictures.run([&] {
            const Geometry coarse = viewer_grid(organ, 2 * grid.spacing[0], most_viewer_voxels / 8);
            shown_values = values(input, coarse, displacement_mm, error_mm);
        });
    pictures.wait();
    result["labels"] = std::move(labels);
    for (auto& [name, picture] :
         {std::pair<const char*, std::string&>{"fixed", fixed}, {"before", before}, {"after", after}})
        if (!picture.empty()) result[name] = std::move(picture);
    if (!shown_values.is_null()) result["values"] = std::move(shown_values);
    return result;
}

}  // namespace tissuewarp::report::detail
