#pragma once
/// The place of a probe, and what a sweep of it makes of echoes.

#include "imaging/volume.hpp"
#include "study/detail/random.hpp"

#include <Eigen/Geometry>

#include <vector>

namespace tissuewarp::study::detail {

/// A curved array that was moved across its plane. Its frame: x along the array, y along the sweep, z along the middle
/// beam, origin where all beams of a plane meet.
struct Sweep {
    Eigen::Isometry3d frame = Eigen::Isometry3d::Identity();  ///< of the sweep in LPS mm
    double first_mm = 0, last_mm = 0;  ///< from where the beams meet: the probe's face, and the depth
    double half_angle = 0;             ///< of the fan, rad
    double half_length_mm = 0;         ///< of the sweep

    struct Shadow {
        double angle = 0, sweep_mm = 0;  ///< its middle
        double half_angle = 0, half_length_mm = 0;
        double from_mm = 0;  ///< as first_mm
        double passes = 0;   ///< of the amplitude
    };
    std::vector<Shadow> shadows;

    [[nodiscard]] bool shows(const Eigen::Vector3d& point) const;
    /// mm along the beam from the probe's face.
    [[nodiscard]] double depth(const Eigen::Vector3d& point) const;
    /// Unit vector away from the probe.
    [[nodiscard]] Eigen::Vector3d beam(const Eigen::Vector3d& point) const;
    /// What shadows let pass.
    [[nodiscard]] double lit(const Eigen::Vector3d& point) const;
};

/// From outside of a point of a surface, whose inward normal the middle beam follows to about 20°.
Sweep random_sweep(const Eigen::Vector3d& surface_point, const Eigen::Vector3d& inward, Random& random);

/// What the scanner makes of the amplitudes of echoes (float32, of the whole grid): resolution, speckle, attenuation,
/// shadows, noise that the gain raises with depth, logarithmic compression; 0 outside of the fan.
imaging::Volume scanned(const imaging::Volume& echoes, const Sweep& sweep, Random& random);

}  // namespace tissuewarp::study::detail
