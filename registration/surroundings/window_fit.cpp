#include "registration/surroundings/window_fit.hpp"

#include "imaging/filters.hpp"

namespace tissuewarp::registration::detail {

using imaging::Volume;

namespace {

constexpr double least_variance = 1e-6, least_total = 1e-6;

}  // namespace

WindowFit::WindowFit(const cv::Mat& a, const Volume& weight, double window_mm)
    : a_(a),
      weight_(weight),
      window_mm_(window_mm),
      total_(cv::max(imaging::smooth(weight, window_mm).voxels, least_total)),
      mean_(window_mean(a)),
      variance_(cv::max(window_mean(a.mul(a)) - mean_.mul(mean_), 0.0)) {}

cv::Mat WindowFit::window_mean(const cv::Mat& values) const {
    const Volume weighted(weight_.geometry, cv::Mat(values.mul(weight_.voxels)));
    return imaging::smooth(weighted, window_mm_).voxels / total_;
}

WindowFit::Line WindowFit::of(const cv::Mat& b) const {
    const cv::Mat mean = window_mean(b);
    const cv::Mat variance = cv::max(window_mean(b.mul(b)) - mean.mul(mean), least_variance);
    const cv::Mat covariance = window_mean(a_.mul(b)) - mean_.mul(mean);
    Line line;
    line.slope = covariance / variance;
    line.offset = mean_ - line.slope.mul(mean);
    line.residual = cv::max(variance_ - line.slope.mul(covariance), 0.0);
    return line;
}

double weighted_variance(const Volume& values, const Volume& weight) {
    const cv::Mat flat = values.voxels.reshape(1, 1), weights = weight.voxels.reshape(1, 1);
    const double total = cv::sum(weights)[0];
    if (!(total > 0)) return 0;
    const double mean = flat.dot(weights) / total;
    return flat.mul(flat).dot(weights) / total - mean * mean;
}

}  // namespace tissuewarp::registration::detail
