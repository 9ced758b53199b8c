#pragma once
/// Marks on pictures: 8-bit BGR matrices of OpenCV.

#include <opencv2/core.hpp>

#include <string>
#include <vector>

namespace tissuewarp::report::detail {

enum class Anchor { Left, Centre, Right };

/// One line of text whose vertical middle is at `place`; a halo keeps it readable on any picture.
void text(cv::Mat& picture, const std::string& line, const cv::Point& place, double size, const cv::Scalar& colour,
          Anchor anchor = Anchor::Left);

/// Grey in [0, 1] (float32) as BGR.
cv::Mat grey_to_colour(const cv::Mat& grey);
/// Values in [−1, 1] (float32): blue below zero, white at zero, red above.
cv::Mat signed_to_colour(const cv::Mat& values);
/// Values in [0, 1] (float32): viridis, whose lightness rises evenly.
cv::Mat magnitude_to_colour(const cv::Mat& values);

/// Outlines of every label of an int32 picture. `sigma` (pixels) rounds the corners of voxels larger than pixels.
void outlines(cv::Mat& picture, const cv::Mat& labels, const cv::Scalar& colour, int thickness, double sigma);

/// About `count` round numbers from zero to at most `limit`.
std::vector<double> round_ticks(double limit, int count);

/// The shortest decimal text that shows a round number.
std::string tick_text(double value);

}  // namespace tissuewarp::report::detail
