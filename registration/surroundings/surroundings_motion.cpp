#include "registration/surroundings/surroundings_motion.hpp"

#include "imaging/places.hpp"
#include "imaging/sampling.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace tissuewarp::registration::detail {

namespace {

using imaging::for_each_place;
using imaging::for_each_place_in_order;
using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

struct MotionOptions {
    double window_mm = 5;        ///< standard deviation of windows
    int steps = 12;              ///< of Gauss-Newton, at most
    double converged_mm = 0.01;  ///< motion of the farthest place in a step
    double tukey = 4.7;          ///< robust standard deviations from which on a place does not count
    double structured = 0.25;    ///< share of the places, of the steepest, that say how much is left where it fits
    double most_left = 0.5;      ///< of the image's standard deviation, that a place counts with among starts
    double unexplained = 0.1;    ///< of the image's variance, from which on there is no such motion
    int fewest = 500;            ///< places that count
};
constexpr MotionOptions options;

/// What a motion leaves, and where to go from it.
struct Linearised {
    Vector6d step = Vector6d::Zero();  ///< turn (radians) about the centre, then shift (mm), in the moving frame
    double left = 1;                   ///< share of the image's variance
    int count = 0;
};

/// One place that counts: what is left there, and how a motion of the place changes it (per mm).
struct Place {
    Eigen::Vector3d at, gradient;
    double residual;
};

/// The intraoperative image as a motion carries it, on the grid, with its gradient in the moving frame.
struct Carried {
    cv::Mat value;
    std::array<cv::Mat, 3> gradient;
    std::vector<std::uint8_t> counts;

    Carried(const Outside& outside, const Eigen::Isometry3d& motion)
        : value(outside.weight.voxels.dims, outside.weight.voxels.size, CV_32F),
          counts(static_cast<std::size_t>(outside.grid.voxel_count())) {
        for (cv::Mat& axis : gradient) axis.create(value.dims, value.size, CV_32F);
        const imaging::LinearSampler fixed(outside.fixed);
        for_each_place(outside.grid, [&](const Eigen::Vector3d& X, std::int64_t n) {
            const Eigen::Vector3d y = motion * X;
            const auto seen = fixed.value_and_gradient(y);
            const Eigen::Vector3d moving = motion.linear().transpose() * seen.gradient;
            value.ptr<float>()[n] = static_cast<float>(seen.value);
            for (int axis = 0; axis < 3; ++axis)
                gradient[static_cast<std::size_t>(axis)].ptr<float>()[n] = static_cast<float>(moving[axis]);
            counts[static_cast<std::size_t>(n)] = outside.weight.data<float>()[n] > 0 && fixed.contains(y);
        });
    }
};

/// The linear maps of intensities follow the motion: of its gradient only what they do not take up changes what is left
/// (variable projection, Golub and Pereyra 1973, but for the slope's own part, which vanishes with the residual).
std::vector<Place> places_of(const Outside& outside, const WindowFit& fit, const Eigen::Isometry3d& motion) {
    const Carried seen(outside, motion);
    const WindowFit::Line line = fit.of(seen.value);
    std::array<WindowFit::Line, 3> taken_up;
    for (std::size_t axis = 0; axis < 3; ++axis)
        taken_up[axis] = WindowFit(seen.gradient[axis], outside.weight, options.window_mm).of(seen.value);
    std::vector<Place> places;
    for_each_place_in_order(outside.grid, [&](const Eigen::Vector3d& X, std::int64_t n) {
        if (!seen.counts[static_cast<std::size_t>(n)]) return;
        const auto at = [n](const cv::Mat& values) { return double{values.ptr<float>()[n]}; };
        const double value = at(seen.value), slope = at(line.slope);
        Eigen::Vector3d gradient;
        for (std::size_t axis = 0; axis < 3; ++axis)
            gradient[static_cast<Eigen::Index>(axis)] =
                slope * (at(seen.gradient[axis]) - at(taken_up[axis].slope) * value - at(taken_up[axis].offset));
        places.push_back({X, gradient, at(outside.moving.voxels) - slope * value - at(line.offset)});
    });
    return places;
}

double middle_of(std::vector<double>& values, double share) {
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

/// Of what is left where the image has structure: air, which most places may lie in, leaves nothing anywhere.
double robust_deviation(const std::vector<Place>& places) {
    std::vector<double> slopes, sizes;
    for (const Place& place : places) slopes.push_back(place.gradient.norm());
    const double steep = middle_of(slopes, 1 - options.structured);
    for (const Place& place : places)
        if (place.gradient.norm() >= steep) sizes.push_back(std::abs(place.residual));
    return 1.4826 * middle_of(sizes, 0.5);
}

Linearised linearised(const std::vector<Place>& places, const Eigen::Vector3d& centre, double variance) {
    Linearised result;
    result.count = static_cast<int>(places.size());
    if (result.count < options.fewest) return result;
    const double limit = options.tukey * robust_deviation(places) + 1e-6 * std::sqrt(variance);
    const double most = std::pow(options.most_left, 2) * variance;
    Matrix6d normal = 1e-9 * Matrix6d::Identity();
    Vector6d right = Vector6d::Zero();
    double left = 0;
    for (const Place& place : places) {
        const double relative = std::min(1.0, std::pow(place.residual / limit, 2));
        left += std::min(std::pow(place.residual, 2), most);
        const double weight = std::pow(1 - relative, 2);
        Vector6d row;
        row << (place.at - centre).cross(place.gradient), place.gradient;
        normal += weight * row * row.transpose();
        right += weight * place.residual * row;
    }
    result.step = normal.ldlt().solve(right);
    result.left = left / (result.count * variance);
    return result;
}

Eigen::Isometry3d rigid(const Vector6d& step, const Eigen::Vector3d& centre) {
    const Eigen::Vector3d turn = step.head<3>();
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
    if (turn.norm() > 0) motion.linear() = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
    motion.translation() = centre + step.tail<3>() - motion.linear() * centre;
    return motion;
}

}  // namespace

std::optional<Eigen::Isometry3d> motion_of_surroundings(const Outside& outside,
                                                        const std::vector<Eigen::Isometry3d>& starts) {
    const double variance = weighted_variance(outside.moving, outside.weight);
    if (!(variance > 0)) return std::nullopt;
    const WindowFit fit(outside.moving.voxels, outside.weight, options.window_mm);
    const auto& size = outside.grid.size;
    const Eigen::Vector3d last(size[0] - 1, size[1] - 1, size[2] - 1);
    const Eigen::Vector3d centre = outside.grid.point(0.5 * last);
    const double reach = (outside.grid.point(last) - centre).norm();
    const auto at = [&](const Eigen::Isometry3d& motion) {
        return linearised(places_of(outside, fit, motion), centre, variance);
    };
    std::optional<Eigen::Isometry3d> best;
    Linearised here;
    for (const Eigen::Isometry3d& start : starts)
        if (const Linearised there = at(start); there.left < here.left) {
            here = there;
            best = start;
        }
    for (int step = 0; best && step < options.steps; ++step) {
        if (here.step.head<3>().norm() * reach + here.step.tail<3>().norm() < options.converged_mm) break;
        const Eigen::Isometry3d next = *best * rigid(here.step, centre);
        const Linearised there = at(next);
        if (!(there.left < here.left)) break;
        here = there;
        best = next;
    }
    return here.left < options.unexplained ? best : std::nullopt;
}

}  // namespace tissuewarp::registration::detail
