#include "report/detail/slice_stack.hpp"

#include "report/detail/display.hpp"
#include "report/detail/drawing.hpp"
#include "report/detail/encoding.hpp"

#include <cstdio>

namespace tissuewarp::report::detail {

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

nlohmann::json slice_stack(const ReportInput& input, int count) {
    nlohmann::json slices = nlohmann::json::array();
    if (input.fixed == nullptr || input.moving == nullptr || input.warped == nullptr) return slices;
    const std::optional<Box> organ = label_box(organ_labels(input));
    if (!organ) return slices;
    constexpr double margin_mm = 12.0, pixels = 260;
    const Box box = around(organ->centre(), organ->extent() + Eigen::Vector3d::Constant(2 * margin_mm));
    const double mm_per_pixel = box.extent().head<2>().maxCoeff() / pixels;
    const Window fixed_window = window_of(*input.fixed, *organ), moving_window = window_of(*input.moving, *organ);
    const double sigma = 0.5 * organ_labels(input).geometry.spacing.maxCoeff() / mm_per_pixel;
    for (int k = 0; k < count; ++k) {
        Eigen::Vector3d point = organ->centre();
        point[2] = organ->lower[2] + organ->extent()[2] * (k + 0.5) / count;
        const Plane plane = planes_through(point, box, mm_per_pixel)[0];
        const cv::Mat outline = label_slice(organ_labels(input), plane);
        const auto encoded = [&](const imaging::Volume& image, const Window& window) {
            cv::Mat picture = grey_to_colour(grey_slice(image, window, plane));
            outlines(picture, outline, cv::Scalar(90, 210, 70), 1, sigma);
            return base64(jpeg(picture, 75));
        };
        char mm[32];
        std::snprintf(mm, sizeof mm, "%.1f", point[2]);
        slices.push_back({{"mm", mm},
                          {"fixed", encoded(*input.fixed, fixed_window)},
                          {"moving", encoded(*input.moving, moving_window)},
                          {"warped", encoded(*input.warped, moving_window)}});
    }
    return slices;
}

}  // namespace tissuewarp::report::detail
