#pragma once
/// Random numbers that are the same with every standard library: the engine is that of the C++ standard, the
/// distributions are written out.

#include <Eigen/Geometry>

#include <cstdint>
#include <random>

namespace tissuewarp::study::detail {

class Random {
public:
    explicit Random(std::uint64_t seed) : engine_(seed) {}

    /// In [0, 1).
    double uniform() { return double(engine_() >> 11) * 0x1p-53; }
    double uniform(double low, double high) { return low + (high - low) * uniform(); }
    /// Uniform in the logarithm; both bounds positive.
    double log_uniform(double low, double high);
    /// 0 … count − 1.
    int index(int count) { return static_cast<int>(uniform() * count); }
    /// Mean 0, variance 1 (Box and Muller 1958).
    double normal();
    Eigen::Vector3d normal3();
    /// Uniform on the unit sphere.
    Eigen::Vector3d direction();
    /// Uniform among rotations (Shoemake 1992: a direction in four dimensions).
    Eigen::Matrix3d rotation();

private:
    std::mt19937_64 engine_;
};

}  // namespace tissuewarp::study::detail
