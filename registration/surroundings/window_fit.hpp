#pragma once
/// The best linear map from one image's intensities to another's in a window around every voxel: what local correlation
/// compares images by.

#include "imaging/volume.hpp"

namespace tissuewarp::registration::detail {

/// Windows are Gaussian, and count voxels by their weight.
class WindowFit {
public:
    /// `a` the voxels of an image on the grid of `weight`, both float32; `window_mm` the standard deviation of the
    /// windows.
    WindowFit(const cv::Mat& a, const imaging::Volume& weight, double window_mm);

    /// b on the same grid: a ≈ slope · b + offset.
    struct Line {
        cv::Mat slope, offset;
        cv::Mat residual;  ///< variance of a that it leaves
    };
    [[nodiscard]] Line of(const cv::Mat& b) const;

private:
    [[nodiscard]] cv::Mat window_mean(const cv::Mat& values) const;

    cv::Mat a_;
    imaging::Volume weight_;
    double window_mm_;
    cv::Mat total_, mean_, variance_;
};

/// Variance of values over all that counts.
double weighted_variance(const imaging::Volume& values, const imaging::Volume& weight);

}  // namespace tissuewarp::registration::detail
