#pragma once
/// Smooth Gaussian fields by random waves: covariance σ² exp(−r²/(2ℓ²)) (Rahimi and Recht 2007).

#include "study/detail/random.hpp"

#include <Eigen/Core>

namespace tissuewarp::study::detail {

/// Of vectors, every component of deviation σ.
class SmoothNoise {
public:
    SmoothNoise(double deviation, double length, Random& random);
    Eigen::Vector3d operator()(const Eigen::Vector3d& point) const;

private:
    static constexpr int waves = 40;  // of each component
    double scale_;
    Eigen::Matrix<double, 3, 3 * waves> wave_;
    Eigen::Matrix<double, 1, 3 * waves> phase_;
};

/// Of numbers.
class SmoothValues {
public:
    SmoothValues(double deviation, double length, Random& random);
    double operator()(const Eigen::Vector3d& point) const;

private:
    static constexpr int waves = 32;
    double scale_;
    Eigen::Matrix<double, 3, waves> wave_;
    Eigen::Matrix<double, 1, waves> phase_;
};

}  // namespace tissuewarp::study::detail
