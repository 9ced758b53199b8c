#include "study/detail/texture.hpp"

#include <cmath>

namespace tissuewarp::study::detail {

Texture::Texture(Random& random) : one_(1, 12, random), other_(1, 12, random) {
    for (const double length : {3.0, 6.0, 12.0, 24.0}) octaves_.emplace_back(7, length, random);
    for (double& level : levels_) level = random.uniform(70, 140);
}

double Texture::operator()(const Eigen::Vector3d& point, int label) const {
    constexpr double vessel_depth = 40;
    double value = levels_[std::size_t(label)];
    for (const SmoothValues& octave : octaves_) value += octave(point);
    return value + vessel_depth * vessel(point);
}

// Where two smooth fields are 0 together.
double Texture::vessel(const Eigen::Vector3d& point) const {
    constexpr double width = 0.12;
    const double off = std::pow(one_(point), 2) + std::pow(other_(point), 2);
    return std::exp(-off / (2 * width * width));
}

imaging::Volume noisy(const imaging::Volume& clean, double deviation, Random& random) {
    imaging::Volume image = clean.clone();
    float* value = image.data<float>();
    for (std::int64_t n = 0; n < image.geometry.voxel_count(); ++n)
        value[n] = static_cast<float>(std::hypot(value[n] + deviation * random.normal(), deviation * random.normal()));
    return image;
}

Eigen::Matrix3d small_turn(double most_deg, Random& random) {
    return Eigen::AngleAxisd(random.uniform(0, most_deg) * EIGEN_PI / 180, random.direction()).toRotationMatrix();
}

}  // namespace tissuewarp::study::detail
