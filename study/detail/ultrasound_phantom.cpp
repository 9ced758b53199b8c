#include "study/detail/ultrasound_phantom.hpp"

#include "imaging/compounding.hpp"
#include "study/detail/phantom_data.hpp"
#include "study/detail/texture.hpp"
#include "study/detail/tracked_frames.hpp"
#include "study/detail/ultrasound_beam.hpp"

#include <array>
#include <cmath>
#include <memory>

namespace tissuewarp::study::detail {

using Eigen::Vector3d;

namespace {

double bell(double x, double deviation) {
    return std::exp(-x * x / (2 * deviation * deviation));
}

/// Thin sheets that reach from the surface into the organ, as sulci do.
class Folds {
public:
    explicit Folds(Random& random) : field_(1, length_mm, random) {}
    /// About the distance to the nearest sheet, mm.
    double distance(const Vector3d& point) const { return length_mm * field_(point); }
    /// 1 near the surface, 0 far in.
    static double reach(double outer_distance) { return 1 / (1 + std::exp(-(outer_distance + depth_mm) / 3)); }

private:
    static constexpr double length_mm = 9, depth_mm = 25;
    SmoothValues field_;
};

/// What both scanners see of tissue at rest.
class Anatomy {
public:
    Anatomy(const TrueTissue& tissue, const EchoOptions& echoes, Random& random)
        : tissue_(tissue), organ_(random), around_(random), folds_(random), own_(1, 5, random) {
        Random of_echoes = random;  // what is drawn besides changes no other draw
        own_amplitude_ = of_echoes.uniform(echoes.least_own, echoes.most_own);
        shared_ = std::exp(of_echoes.uniform(std::log(echoes.least_shared), std::log(echoes.most_shared)));
        for (double& level : scatter_) level = std::exp(random.uniform(-0.7, 0.7));
        for (double& slope : slope_) slope = random.uniform(-0.4, 0.4);
        boundary_ = random.uniform(0.5, 2);
    }

    /// Grey value in the first image.
    double shown(const Vector3d& X) const {
        constexpr double fluid = -60, rind = -20, fluid_mm = 1.2, rind_mm = 3.5;
        const int label = tissue_.label(X);
        if (label == 0) return around_(X, 0);
        const double d = folds_.distance(X), reach = Folds::reach(tissue_.outer_distance(X));
        return std::max(0.0, organ_(X, label) + reach * (fluid * bell(d, fluid_mm) + rind * bell(d, rind_mm)));
    }

    /// Amplitude of the echo along a beam (unit vector in the frame at rest).
    double echo(const Vector3d& X, const Vector3d& beam) const {
        constexpr double sheet = 5, sheet_mm = 0.9, lumen = 0.7, per_grey = 0.05, step_mm = 0.75;
        const int label = tissue_.label(X);
        const double grey = shown(X);
        const std::size_t kind = std::size_t(label);
        double scatter =
            scatter_[kind] * std::exp(own_amplitude_ * own_(X) + shared_ * slope_[kind] * (grey - 100) / 20);
        const double along = (shown(X + step_mm * beam) - shown(X - step_mm * beam)) / (2 * step_mm);
        double echo = per_grey * std::abs(along);
        if (label > 0) {
            scatter *= 1 - shared_ * lumen * organ_.vessel(X);
            const Vector3d n = slope([&](const Vector3d& p) { return folds_.distance(p); }, X).normalized();
            const double d = folds_.distance(X), reach = Folds::reach(tissue_.outer_distance(X));
            echo += sheet * reach * bell(d, sheet_mm) * facing(n, beam);
        }
        const double out = tissue_.outer_distance(X);
        if (std::abs(out) < 3)
            echo += boundary_ * bell(out, sheet_mm) *
                    facing(slope([&](const Vector3d& p) { return tissue_.outer_distance(p); }, X).normalized(), beam);
        return scatter + shared_ * echo;
    }

private:
    const TrueTissue& tissue_;
    Texture organ_, around_;
    Folds folds_;
    SmoothValues own_;
    std::array<double, 3> scatter_{}, slope_{};
    double boundary_ = 1, own_amplitude_ = 0, shared_ = 1;

    /// Interfaces scatter all ways, and most back to where the beam came from.
    static double facing(const Vector3d& normal, const Vector3d& beam) {
        constexpr double all_ways = 0.35;
        return all_ways + (1 - all_ways) * std::abs(normal.dot(beam));
    }

    template <class Value>
    static Vector3d slope(const Value& value, const Vector3d& X) {
        constexpr double step_mm = 0.5;
        Vector3d g;
        for (int axis = 0; axis < 3; ++axis)
            g[axis] = value(X + step_mm * Vector3d::Unit(axis)) - value(X - step_mm * Vector3d::Unit(axis));
        return g;
    }
};

/// A grid along a sweep that holds its fan.
imaging::Geometry grid_of(const Sweep& sweep, double voxel_mm) {
    Eigen::Matrix3Xd corners(3, 6);
    const double s = std::sin(sweep.half_angle), c = std::cos(sweep.half_angle), y = sweep.half_length_mm;
    corners << -s * sweep.last_mm, s * sweep.last_mm, 0, 0, 0, 0,  //
        -y, y, 0, 0, 0, 0,                                         //
        sweep.first_mm * c, sweep.last_mm, sweep.last_mm, sweep.last_mm, sweep.last_mm, sweep.last_mm;
    constexpr double margin_mm = 3;
    const Vector3d lower = corners.rowwise().minCoeff() - Vector3d::Constant(margin_mm),
                   extent = corners.rowwise().maxCoeff() + Vector3d::Constant(margin_mm) - lower;
    imaging::Geometry grid;
    grid.spacing.setConstant(voxel_mm);
    grid.direction = sweep.frame.linear();
    grid.origin = sweep.frame * lower;
    for (std::size_t axis = 0; axis < 3; ++axis)
        grid.size[axis] = static_cast<int>(std::ceil(extent[Eigen::Index(axis)] / voxel_mm)) + 1;
    return grid;
}

}  // namespace

PhantomUltrasound drawn_ultrasound(const TrueTissue& tissue, const EchoOptions& options, Random& random) {
    constexpr double moving_voxel_mm = 1.25, fixed_voxel_mm = 0.8, noise = 3, most_turn_deg = 15;
    constexpr double distortion_mm = 0.3, distortion_length_mm = 25, compounded_voxel_mm = 0.5;
    const Anatomy anatomy(tissue, options, random);
    const SmoothNoise distortion(distortion_mm, distortion_length_mm, random);
    const Eigen::Matrix3Xd after = surface_samples(tissue, 60, random);
    Eigen::Matrix3Xd before(3, after.cols());
    const Eigen::Isometry3d back = tissue.placement.inverse();
    for (Eigen::Index p = 0; p < after.cols(); ++p)
        before.col(p) = tissue.backward(after.col(p)).value_or(back * after.col(p));
    const Vector3d middle = tissue.placement * tissue.centre, seen = after.col(random.index(int(after.cols())));
    const Sweep sweep = random_sweep(seen, (middle - seen).normalized(), random);

    PhantomUltrasound result;
    const Eigen::Matrix3d axes = small_turn(most_turn_deg, random);
    result.moving = noisy(
        filled(random_grid(before, axes, moving_voxel_mm, random), [&](const Vector3d& X) { return anatomy.shown(X); }),
        noise, random);
    const imaging::Volume echoes = filled(grid_of(sweep, fixed_voxel_mm), [&](const Vector3d& x) {
        if (!sweep.shows(x)) return 0.0;
        const Vector3d place = x + distortion(x);
        return anatomy.echo(tissue.backward(place).value_or(back * place), back.linear() * sweep.beam(x));
    });
    result.fixed = scanned(echoes, sweep, random);
    if (options.tracked) {
        const imaging::Sweep frames = tracked_frames(result.fixed, sweep, {}, random);
        result.fixed = imaging::compound(frames, {.spacing_mm = compounded_voxel_mm}).volume.as(CV_32F);
    }
    result.shows = [sweep](const Vector3d& x) { return sweep.shows(x); };
    return result;
}

}  // namespace tissuewarp::study::detail
