#pragma once
/// A textured volume known everywhere, and what a second scanner would make of it after a deformation.

#include "tests/registration/shapes.hpp"

#include <opencv2/core.hpp>

#include <functional>
#include <vector>

namespace tissuewarp::registration::test {

/// Sum of plane waves of 8 to 24 mm, about −1 … 1.
class Texture {
public:
    Texture() {
        cv::RNG random(7);
        for (int n = 0; n < waves; ++n) {
            Eigen::Vector3d direction(random.gaussian(1), random.gaussian(1), random.gaussian(1));
            waves_[n] = {2 * EIGEN_PI / random.uniform(8.0, 24.0) * direction.normalized(),
                         random.uniform(0.0, 2 * EIGEN_PI)};
        }
    }
    [[nodiscard]] double operator()(const Eigen::Vector3d& x) const {
        double sum = 0;
        for (const Wave& wave : waves_) sum += std::cos(wave.vector.dot(x) + wave.phase);
        return sum / 8;
    }

private:
    static constexpr int waves = 32;
    struct Wave {
        Eigen::Vector3d vector;
        double phase;
    };
    std::array<Wave, waves> waves_;
};

/// Displacement of the phantom, up to about 5 mm and 15 % strain.
inline Eigen::Vector3d smooth_displacement(const Eigen::Vector3d& x) {
    return {3 * std::sin(x[1] / 22) + 1, 2.5 * std::cos(x[0] / 25), 3 * std::sin((x[0] + x[2]) / 30)};
}

/// The point that the displacement brings to y.
inline Eigen::Vector3d before_displacement(const Eigen::Vector3d& y) {
    Eigen::Vector3d x = y;
    for (int n = 0; n < 30; ++n) x = y - smooth_displacement(x);
    return x;
}

/// Voxels value(point) plus noise of a standard deviation.
inline imaging::Volume sampled(const imaging::Geometry& grid,
                               const std::function<double(const Eigen::Vector3d&)>& value, double noise = 0,
                               unsigned seed = 1) {
    imaging::Volume image(grid, CV_32FC1);
    cv::RNG random(seed);
    for_each_voxel(image, [&](const Eigen::Vector3d& index, std::int64_t offset) {
        image.data<float>()[offset] = static_cast<float>(value(grid.point(index)) + random.gaussian(noise));
    });
    return image;
}

/// A mask of the points that lie at least `rim_mm` within the box of the grid.
inline imaging::Volume core_mask(const imaging::Geometry& grid, double rim_mm) {
    imaging::Volume mask(grid, CV_8UC1);
    for_each_voxel(mask, [&](const Eigen::Vector3d& index, std::int64_t offset) {
        const Eigen::Vector3d last(grid.size[0] - 1, grid.size[1] - 1, grid.size[2] - 1);
        const Eigen::Array3d inside = (index.cwiseMin(last - index)).cwiseProduct(grid.spacing).array();
        mask.data<std::uint8_t>()[offset] = inside.minCoeff() >= rim_mm;
    });
    return mask;
}

}  // namespace tissuewarp::registration::test
