#include "core/errors.hpp"
#include "imaging/filters.hpp"

#include <opencv2/imgproc.hpp>

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <sstream>

namespace tissuewarp::imaging {

namespace {

/// Sampled Gaussian, cut at 4 standard deviations (weight beyond: 6e-5), normalised. `sigma` in voxels.
cv::Mat gaussian_kernel(double sigma) {
    const int radius = std::max(1, static_cast<int>(std::ceil(4.0 * sigma)));
    return cv::getGaussianKernel(2 * radius + 1, sigma, CV_32F);
}

/// Along i and j: slices are independent two-dimensional images.
void smooth_slices(const cv::Mat& source, cv::Mat& target, const cv::Mat& kernel_i, const cv::Mat& kernel_j) {
    const int nz = source.size[0], ny = source.size[1], nx = source.size[2];
    tbb::parallel_for(0, nz, [&](int k) {
        const cv::Mat from(ny, nx, source.type(), const_cast<uchar*>(source.ptr(k)));  // read only
        cv::Mat to(ny, nx, target.type(), target.ptr(k));
        cv::sepFilter2D(from, to, CV_32F, kernel_i, kernel_j, cv::Point(-1, -1), 0, cv::BORDER_REPLICATE);
    });
}

/// Along k: the volume seen as one image with a row per slice, cut into strips of columns. The strips do not depend on
/// the number of threads, and neither does what the vector units make of each.
void smooth_across_slices(const cv::Mat& source, cv::Mat& target, const cv::Mat& kernel_k) {
    constexpr int strip = 2048;
    const int nz = source.size[0], columns = source.size[1] * source.size[2];
    const cv::Mat from(nz, columns, source.type(), const_cast<uchar*>(source.data));  // read only
    cv::Mat to(nz, columns, target.type(), target.data);
    const cv::Mat identity = cv::Mat::ones(1, 1, CV_32F);
    tbb::parallel_for(0, (columns + strip - 1) / strip, [&](int s) {
        const cv::Range range(s * strip, std::min(columns, (s + 1) * strip));
        cv::Mat part = to.colRange(range);
        cv::sepFilter2D(from.colRange(range), part, CV_32F, identity, kernel_k, cv::Point(-1, -1), 0,
                        cv::BORDER_REPLICATE);
    });
}

}  // namespace

Volume smooth(const Volume& image, double sigma_mm) {
    if (!(sigma_mm >= 0.0) || !std::isfinite(sigma_mm)) {
        std::ostringstream value;
        value << "smoothing: standard deviation " << sigma_mm << " mm; give a finite length of 0 mm or more";
        throw InvalidInput(value.str());
    }
    if (sigma_mm == 0.0) return image.clone().as(CV_32F);
    const Eigen::Vector3d sigma = sigma_mm * image.geometry.spacing.cwiseInverse();
    const Volume source = image.as(CV_32F);
    cv::Mat in_slices(3, source.voxels.size.p, source.voxels.type());
    smooth_slices(source.voxels, in_slices, gaussian_kernel(sigma[0]), gaussian_kernel(sigma[1]));
    cv::Mat result(3, source.voxels.size.p, source.voxels.type());
    smooth_across_slices(in_slices, result, gaussian_kernel(sigma[2]));
    return {image.geometry, result};
}

Volume gradient(const Volume& image) {
    if (image.channels() != 1) throw InvalidInput("gradient: the image holds vectors; give a scalar volume");
    const Volume source = image.as(CV_32F);
    Volume result(image.geometry, CV_32FC3);
    const auto [nx, ny, nz] = image.geometry.size;
    // d/dpoint = (point_to_index)^T d/dindex
    const Eigen::Matrix3f to_lps = image.geometry.point_to_index().transpose().cast<float>();
    const float* values = source.data<float>();
    float* gradients = result.voxels.ptr<float>();
    const auto slope = [&](int position, int size, std::int64_t here, std::int64_t stride) {
        const bool below = position > 0, above = position + 1 < size;
        if (!below && !above) return 0.0F;
        const float difference = values[above ? here + stride : here] - values[below ? here - stride : here];
        return below && above ? 0.5F * difference : difference;
    };
    tbb::parallel_for(0, nz, [&, nx = nx, ny = ny, nz = nz](int k) {
        for (int j = 0; j < ny; ++j)
            for (int i = 0; i < nx; ++i) {
                const std::int64_t here = source.offset(i, j, k);
                const Eigen::Vector3f by_index(slope(i, nx, here, 1), slope(j, ny, here, nx),
                                               slope(k, nz, here, std::int64_t{nx} * ny));
                Eigen::Map<Eigen::Vector3f>(gradients + 3 * here) = to_lps * by_index;
            }
    });
    return result;
}

}  // namespace tissuewarp::imaging
