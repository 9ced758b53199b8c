#include "study/detail/bent_map.hpp"

#include <algorithm>
#include <cmath>

namespace tissuewarp::study::detail {

using Eigen::Vector3d;

BentMap::BentMap(const Vector3d& centre, double length_mm, double motion_mm, Random& random) : centre_(centre) {
    constexpr double most_strain = 0.5;
    const auto count = double(shears_.size());
    for (Shear& shear : shears_) {
        const Vector3d along = random.direction();
        const double wave = 2 * EIGEN_PI / (length_mm * random.uniform(0.7, 1.5));
        shear.wave = wave * along;
        shear.amplitude =
            std::min(motion_mm, most_strain / wave) / count * along.cross(random.direction()).normalized();
        shear.phase = random.uniform(0, 2 * EIGEN_PI);
    }
}

Vector3d BentMap::Shear::at(const Vector3d& point) const {
    return amplitude * std::cos(wave.dot(point) + phase);
}

Vector3d BentMap::forward(Vector3d point) const {
    for (const Shear& shear : shears_) point += shear.at(point - centre_);
    return point;
}

Vector3d BentMap::backward(Vector3d point) const {
    for (auto shear = shears_.rbegin(); shear != shears_.rend(); ++shear) point -= shear->at(point - centre_);
    return point;
}

}  // namespace tissuewarp::study::detail
