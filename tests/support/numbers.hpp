#pragma once
/// Random numbers for tests.

#include <Eigen/Core>

#include <random>

namespace tissuewarp::test {

/// Repeatable numbers, the same with every standard library.
class Numbers {
public:
    explicit Numbers(unsigned seed) : engine_(seed) {}
    double between(double low, double high) { return low + (high - low) * (double(engine_()) / 4294967295.0); }
    Eigen::Vector3d in_cube() { return {between(-1, 1), between(-1, 1), between(-1, 1)}; }
    Eigen::Vector3d direction() {
        for (;;) {
            const Eigen::Vector3d x = in_cube();
            if (x.norm() > 0.1 && x.norm() < 1) return x.normalized();
        }
    }
    /// Nearly Gaussian, of deviation one.
    Eigen::Vector3d noise() {
        Eigen::Vector3d sum = Eigen::Vector3d::Zero();
        for (int n = 0; n < 12; ++n) sum += 0.5 * in_cube();
        return sum;
    }

private:
    std::mt19937 engine_;
};

}  // namespace tissuewarp::test
