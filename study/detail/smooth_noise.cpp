#include "study/detail/smooth_noise.hpp"

#include <cmath>

namespace tissuewarp::study::detail {

using Eigen::Vector3d;

SmoothNoise::SmoothNoise(double deviation, double length, Random& random) : scale_(deviation * std::sqrt(2.0 / waves)) {
    for (Eigen::Index w = 0; w < 3 * waves; ++w) {
        wave_.col(w) = random.normal3() / length;
        phase_[w] = random.uniform(0, 2 * EIGEN_PI);
    }
}

Vector3d SmoothNoise::operator()(const Vector3d& point) const {
    const Eigen::Array<double, 1, 3 * waves> value = (point.transpose() * wave_ + phase_).array().cos();
    return scale_ * Vector3d(value.segment<waves>(0).sum(), value.segment<waves>(waves).sum(),
                             value.segment<waves>(2 * waves).sum());
}

SmoothValues::SmoothValues(double deviation, double length, Random& random)
    : scale_(deviation * std::sqrt(2.0 / waves)) {
    for (Eigen::Index w = 0; w < waves; ++w) {
        wave_.col(w) = random.normal3() / length;
        phase_[w] = random.uniform(0, 2 * EIGEN_PI);
    }
}

double SmoothValues::operator()(const Vector3d& point) const {
    return scale_ * (point.transpose() * wave_ + phase_).array().cos().sum();
}

}  // namespace tissuewarp::study::detail
