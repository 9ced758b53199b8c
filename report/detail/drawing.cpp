#include "report/detail/drawing.hpp"

#include <opencv2/imgproc.hpp>

#include <array>
#include <cmath>
#include <cstdio>
#include <set>

namespace tissuewarp::report::detail {

void text(cv::Mat& picture, const std::string& line, const cv::Point& place, double size, const cv::Scalar& colour,
          Anchor anchor) {
    int baseline = 0;
    const cv::Size extent = cv::getTextSize(line, cv::FONT_HERSHEY_SIMPLEX, size, 1, &baseline);
    cv::Point start(place.x, place.y + extent.height / 2);
    if (anchor == Anchor::Centre) start.x -= extent.width / 2;
    if (anchor == Anchor::Right) start.x -= extent.width;
    const cv::Scalar halo(12, 12, 12);
    cv::putText(picture, line, start, cv::FONT_HERSHEY_SIMPLEX, size, halo, 4, cv::LINE_AA);
    cv::putText(picture, line, start, cv::FONT_HERSHEY_SIMPLEX, size, colour, 1, cv::LINE_AA);
}

cv::Mat grey_to_colour(const cv::Mat& grey) {
    cv::Mat bytes, colour;
    grey.convertTo(bytes, CV_8U, 255);
    cv::cvtColor(bytes, colour, cv::COLOR_GRAY2BGR);
    return colour;
}

cv::Mat signed_to_colour(const cv::Mat& values) {
    // Anchors of ColorBrewer's RdBu reversed, BGR.
    static const cv::Mat table = [] {
        const std::array<cv::Vec3d, 5> anchors{
            {{120, 60, 10}, {195, 147, 67}, {247, 247, 247}, {77, 96, 214}, {31, 0, 120}}};
        cv::Mat colours(1, 256, CV_8UC3);
        for (int k = 0; k < 256; ++k) {
            const double at = k / 255.0 * 4;
            const auto below = std::min<std::size_t>(static_cast<std::size_t>(at), 3);
            const double part = at - static_cast<double>(below);
            const cv::Vec3d mixed = anchors[below] * (1 - part) + anchors[below + 1] * part;
            colours.at<cv::Vec3b>(k) = cv::Vec3b(cv::saturate_cast<uchar>(mixed[0]), cv::saturate_cast<uchar>(mixed[1]),
                                                 cv::saturate_cast<uchar>(mixed[2]));
        }
        return colours;
    }();
    cv::Mat bytes, colour;
    values.convertTo(bytes, CV_8U, 127.5, 127.5);
    cv::cvtColor(bytes, bytes, cv::COLOR_GRAY2BGR);
    cv::LUT(bytes, table, colour);
    return colour;
}

cv::Mat magnitude_to_colour(const cv::Mat& values) {
    cv::Mat bytes, colour;
    values.convertTo(bytes, CV_8U, 255);
    cv::applyColorMap(bytes, colour, cv::COLORMAP_VIRIDIS);
    return colour;
}

void outlines(cv::Mat& picture, const cv::Mat& labels, const cv::Scalar& colour, int thickness, double sigma) {
    const std::set<int> present(labels.begin<int>(), labels.end<int>());
    for (const int label : present) {
        if (label == 0) continue;
        cv::Mat mask = labels == label;
        if (sigma > 0.3) {
            cv::GaussianBlur(mask, mask, cv::Size(), sigma, sigma, cv::BORDER_REPLICATE);
            mask = mask >= 128;
        }
        std::vector<std::vector<cv::Point>> contours;
        cv::findContours(mask, contours, cv::RETR_LIST, cv::CHAIN_APPROX_NONE);
        cv::drawContours(picture, contours, -1, colour, thickness, cv::LINE_AA);
    }
}

std::vector<double> round_ticks(double limit, int count) {
    if (!(limit > 0) || !std::isfinite(limit)) return {0.0};
    const double raw = limit / count, power = std::pow(10.0, std::floor(std::log10(raw)));
    const double digit = raw / power;
    const double step = (digit <= 1 ? 1 : digit <= 2 ? 2 : digit <= 5 ? 5 : 10) * power;
    std::vector<double> ticks;
    for (int k = 0; k * step <= limit * (1 + 1e-9); ++k) ticks.push_back(k * step);
    return ticks;
}

std::string tick_text(double value) {
    char buffer[32];
    std::snprintf(buffer, sizeof buffer, "%.6g", value);
    return buffer;
}

}  // namespace tissuewarp::report::detail
