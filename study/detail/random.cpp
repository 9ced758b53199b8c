#include "study/detail/random.hpp"

#include <cmath>

namespace tissuewarp::study::detail {

double Random::log_uniform(double low, double high) {
    return low * std::exp(uniform() * std::log(high / low));
}

double Random::normal() {
    const double radius = std::sqrt(-2 * std::log(1 - uniform()));
    return radius * std::cos(2 * EIGEN_PI * uniform());
}

Eigen::Vector3d Random::normal3() {
    const double x = normal(), y = normal(), z = normal();
    return {x, y, z};
}

Eigen::Vector3d Random::direction() {
    return normal3().normalized();
}

Eigen::Matrix3d Random::rotation() {
    const double w = normal();
    const Eigen::Vector3d v = normal3();
    return Eigen::Quaterniond(w, v[0], v[1], v[2]).normalized().toRotationMatrix();
}

}  // namespace tissuewarp::study::detail
