#pragma once
/// A fibre's direction in 32 bits, as patches on a GPU keep it (shaders/chunks/patch.fibre.glsl): a fibre has no sense,
/// so the half z ≥ 0 of the octahedron |x| + |y| + z = 1 is enough, x and y in 16 bits each as unpackSnorm2x16 of GLSL
/// reads them.

#include <Eigen/Core>

#include <cmath>
#include <cstdint>

namespace tissuewarp::tled::detail {

/// Precondition: not zero. Turns it by 7e-5 at most.
inline std::uint32_t folded_fibre(const Eigen::Vector3d& fibre) {
    const double scale = (fibre.z() < 0 ? -32767 : 32767) / fibre.lpNorm<1>();
    const auto number = [&](double component) {
        return static_cast<std::uint32_t>(static_cast<std::uint16_t>(std::lround(scale * component)));
    };
    return number(fibre.x()) | number(fibre.y()) << 16U;
}

/// The unit vector, or its opposite.
inline Eigen::Vector3d unfolded_fibre(std::uint32_t folded) {
    const auto number = [](std::uint32_t bits) { return static_cast<std::int16_t>(bits & 0xffffU) / 32767.0; };
    const double x = number(folded), y = number(folded >> 16U);
    return Eigen::Vector3d(x, y, 1 - std::abs(x) - std::abs(y)).normalized();
}

}  // namespace tissuewarp::tled::detail
