#include "study/detail/ultrasound_beam.hpp"

#include "imaging/filters.hpp"

#include <algorithm>
#include <cmath>

namespace tissuewarp::study::detail {

using Eigen::Vector3d;

namespace {

/// In the frame of a sweep.
struct BeamPlace {
    double angle, sweep_mm, distance_mm;
};

BeamPlace place_of(const Sweep& sweep, const Vector3d& point) {
    const Vector3d p = sweep.frame.inverse() * point;
    return {std::atan2(p.x(), p.z()), p.y(), std::hypot(p.x(), p.z())};
}

/// Gaussian noise of a deviation of 1 that resolution cells share.
imaging::Volume cells(const imaging::Geometry& grid, double cell_mm, Random& random) {
    imaging::Volume noise(grid, CV_32FC1);
    float* value = noise.data<float>();
    for (std::int64_t n = 0; n < grid.voxel_count(); ++n) value[n] = static_cast<float>(random.normal());
    imaging::Volume smooth = imaging::smooth(noise, cell_mm);
    double squares = 0;
    float* s = smooth.data<float>();
    for (std::int64_t n = 0; n < grid.voxel_count(); ++n) squares += double(s[n]) * s[n];
    const auto scale = static_cast<float>(1 / std::sqrt(squares / double(grid.voxel_count())));
    for (std::int64_t n = 0; n < grid.voxel_count(); ++n) s[n] *= scale;
    return smooth;
}

/// Power of speckle of mean 1, of a few looks that were compounded.
imaging::Volume squared_cells(const imaging::Geometry& grid, double cell_mm, Random& random) {
    constexpr int looks = 3;
    imaging::Volume power(grid, CV_32FC1);
    power.voxels = 0;
    for (int part = 0; part < 2 * looks; ++part) {
        const imaging::Volume noise = cells(grid, cell_mm, random);
        for (std::int64_t n = 0; n < grid.voxel_count(); ++n)
            power.data<float>()[n] += noise.data<float>()[n] * noise.data<float>()[n] / (2 * looks);
    }
    return power;
}

}  // namespace

bool Sweep::shows(const Vector3d& point) const {
    const BeamPlace at = place_of(*this, point);
    return std::abs(at.angle) <= half_angle && std::abs(at.sweep_mm) <= half_length_mm && at.distance_mm >= first_mm &&
           at.distance_mm <= last_mm;
}

double Sweep::depth(const Vector3d& point) const {
    return place_of(*this, point).distance_mm - first_mm;
}

Vector3d Sweep::beam(const Vector3d& point) const {
    Vector3d p = frame.inverse() * point;
    p.y() = 0;
    return frame.linear() * p.normalized();
}

double Sweep::lit(const Vector3d& point) const {
    const BeamPlace at = place_of(*this, point);
    double result = 1;
    for (const Shadow& shadow : shadows) {
        const double a = (at.angle - shadow.angle) / shadow.half_angle,
                     b = (at.sweep_mm - shadow.sweep_mm) / shadow.half_length_mm;
        if (at.distance_mm > shadow.from_mm && a * a + b * b < 1) result *= shadow.passes;
    }
    return result;
}

Sweep random_sweep(const Vector3d& surface_point, const Vector3d& inward, Random& random) {
    constexpr double most_lean_deg = 20;
    Sweep sweep;
    sweep.first_mm = random.uniform(10, 20);
    sweep.last_mm = sweep.first_mm + random.uniform(50, 70);
    sweep.half_angle = random.uniform(28, 38) * EIGEN_PI / 180;
    sweep.half_length_mm = random.uniform(18, 28);
    const double lean = random.uniform(0, most_lean_deg) * EIGEN_PI / 180;
    const Vector3d z = Eigen::AngleAxisd(lean, inward.cross(random.direction()).normalized()) * inward;
    const Vector3d x = z.cross(random.direction()).normalized();
    sweep.frame.linear() << x, z.cross(x), z;
    constexpr double stand_off_mm = 4;
    sweep.frame.translation() = surface_point - (sweep.first_mm + stand_off_mm) * z;
    for (int shadow = random.index(4); shadow > 0; --shadow)
        sweep.shadows.push_back({random.uniform(-1, 1) * sweep.half_angle, random.uniform(-1, 1) * sweep.half_length_mm,
                                 random.uniform(0.05, 0.14), random.uniform(4, 12),
                                 random.uniform(sweep.first_mm, sweep.last_mm), random.uniform(0.1, 0.5)});
    return sweep;
}

imaging::Volume scanned(const imaging::Volume& echoes, const Sweep& sweep, Random& random) {
    constexpr double resolution_mm = 0.7, cell_mm = 0.6;  // deviations
    constexpr double db_per_mm = 0.15, gain_short = 0.85, near_field_mm = 4;
    constexpr double grey = 42, grey_per_e = 16, brightest = 255;
    const double noise = random.uniform(0.05, 0.15);
    const imaging::Geometry& grid = echoes.geometry;
    const imaging::Volume blurred = imaging::smooth(echoes, resolution_mm),
                          speckle = squared_cells(grid, cell_mm, random),
                          silence = squared_cells(grid, cell_mm, random);
    imaging::Volume image(grid, CV_32FC1);
    float* value = image.data<float>();
    std::int64_t n = 0;
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i, ++n) {
                const Vector3d point = grid.point({double(i), double(j), double(k)});
                value[n] = 0;
                if (!sweep.shows(point)) continue;
                const double depth = sweep.depth(point), lost = std::pow(10, -db_per_mm * depth / 20),
                             gain = std::pow(lost, -gain_short);
                const double haze = 1 + 2 * std::exp(-depth / near_field_mm);
                const double amplitude = blurred.data<float>()[n] * sweep.lit(point) * lost * haze,
                             power = amplitude * amplitude * speckle.data<float>()[n] +
                                     noise * noise * silence.data<float>()[n];
                value[n] = static_cast<float>(
                    std::clamp(grey + grey_per_e * std::log(gain * std::sqrt(power) + 1e-3), 1.0, brightest));
            }
    return image;
}

}  // namespace tissuewarp::study::detail
