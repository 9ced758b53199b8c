#include "registration/loads/white_noise.hpp"

#include <cmath>

namespace tissuewarp::registration::detail {

Eigen::MatrixXd white_noise(Eigen::Index rows, Eigen::Index columns, std::mt19937_64& generator) {
    Eigen::MatrixXd noise(rows, columns);
    for (Eigen::Index k = 0; k < noise.size(); ++k) {
        const double radius = std::sqrt(-2 * std::log(uniform(generator)));
        noise.data()[k] = radius * std::cos(2 * EIGEN_PI * uniform(generator));
    }
    return noise;
}

}  // namespace tissuewarp::registration::detail
