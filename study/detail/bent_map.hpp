#pragma once
/// A smooth motion that conserves volume and solves no equation of any tissue.

#include "study/detail/random.hpp"

#include <Eigen/Core>

#include <array>

namespace tissuewarp::study::detail {

/// Three shears one after the other, x + a cos(k · x + φ) with a ⟂ k: each conserves volume, and since it leaves k · x
/// as it is each is undone exactly by its opposite.
class BentMap {
public:
    /// Waves of 0.7 to 1.5 times `length_mm`, that move no point further than `motion_mm` together and strain no tissue
    /// by more than a half.
    BentMap(const Eigen::Vector3d& centre, double length_mm, double motion_mm, Random& random);

    [[nodiscard]] Eigen::Vector3d forward(Eigen::Vector3d point) const;
    [[nodiscard]] Eigen::Vector3d backward(Eigen::Vector3d point) const;

private:
    struct Shear {
        Eigen::Vector3d wave, amplitude;  ///< radians per mm; mm
        double phase;

        [[nodiscard]] Eigen::Vector3d at(const Eigen::Vector3d& point) const;
    };
    Eigen::Vector3d centre_;
    std::array<Shear, 3> shears_;
};

}  // namespace tissuewarp::study::detail
