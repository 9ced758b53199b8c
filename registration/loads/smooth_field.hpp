#pragma once
/// Smooth Gaussian fields of vectors by random waves (Rahimi and Recht 2007).

#include "registration/loads/white_noise.hpp"

#include <Eigen/Core>

#include <cmath>
#include <random>
#include <vector>

namespace tissuewarp::registration::detail {

/// Each component of variance 1, its covariance exp(−r²/(2ℓ²)).
class SmoothField {
public:
    SmoothField(double length_mm, std::mt19937_64& generator)
        : wave_(white_noise(3, 3 * waves, generator) / length_mm) {
        for (double& phase : phase_) phase = 2 * EIGEN_PI * uniform(generator);
    }
    [[nodiscard]] Eigen::Vector3d operator()(const Eigen::Vector3d& point) const {
        Eigen::Vector3d sum = Eigen::Vector3d::Zero();
        for (int w = 0; w < 3 * waves; ++w) sum[w / waves] += std::cos(wave_.col(w).dot(point) + phase_[w]);
        return std::sqrt(2.0 / waves) * sum;
    }

private:
    static constexpr int waves = 20;  // of each component. Chosen by hand; on which data is not recorded
    Eigen::Matrix<double, 3, 3 * waves> wave_;
    Eigen::Matrix<double, 3 * waves, 1> phase_;
};

/// As smooth, and without divergence: every wave moves across its own direction.
class SolenoidalField {
public:
    SolenoidalField(double length_mm, int waves, std::mt19937_64& generator) {
        for (int w = 0; w < waves; ++w) {
            const Eigen::Vector3d wave = white_noise(3, 1, generator) / length_mm;
            const Eigen::Vector3d any = white_noise(3, 1, generator);
            const Eigen::Vector3d across = any - wave * (wave.dot(any) / wave.squaredNorm());
            waves_.push_back({wave, std::sqrt(2.0 / waves) * across, double(2 * EIGEN_PI) * uniform(generator)});
        }
    }
    [[nodiscard]] Eigen::Vector3d operator()(const Eigen::Vector3d& point) const {
        Eigen::Vector3d sum = Eigen::Vector3d::Zero();
        for (const Wave& wave : waves_) sum += std::cos(wave.number.dot(point) + wave.phase) * wave.amplitude;
        return sum;
    }

private:
    struct Wave {
        Eigen::Vector3d number, amplitude;
        double phase;
    };
    std::vector<Wave> waves_;
};

}  // namespace tissuewarp::registration::detail
