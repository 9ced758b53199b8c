#include "study/detail/tracked_frames.hpp"

#include "imaging/sampling.hpp"

#include <tbb/parallel_for.h>

#include <cmath>

namespace tissuewarp::study::detail {

namespace {

using Eigen::Vector3d;

constexpr double pixel_mm = 0.3, least_step_mm = 0.3, most_step_mm = 0.9;
constexpr double margin_mm = 3;
constexpr double wander_mm = 0.15, tilt_deg = 0.25;  // deviations of what a frame adds to the one before

Eigen::Isometry3d small_motion(double mm, double degrees, Random& random) {
    const Vector3d turn = degrees * EIGEN_PI / 180 * random.normal3();
    return Eigen::Translation3d(mm * random.normal3()) *
           Eigen::Isometry3d(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
}

/// From the frame's own axes (x along the array, z away from it, mm) to LPS.
std::vector<Eigen::Isometry3d> hand_held(const Sweep& sweep, Random& random) {
    std::vector<Eigen::Isometry3d> places;
    Eigen::Isometry3d hand = Eigen::Isometry3d::Identity();
    const double end = sweep.half_length_mm - margin_mm;
    for (double y = -end; y <= end; y += random.uniform(least_step_mm, most_step_mm)) {
        hand = hand * small_motion(wander_mm, tilt_deg, random);
        places.push_back(sweep.frame * Eigen::Translation3d(0, y, 0) * hand);
    }
    return places;
}

/// Whether a place in the plane of a frame lies in its own fan. That is smaller than the fan of the whole sweep: a hand
/// that wanders must not leave what is drawn.
bool in_own_fan(const Sweep& sweep, const Vector3d& place) {
    const double r = std::hypot(place.x(), place.z()), angle = std::abs(std::atan2(place.x(), place.z()));
    return r > sweep.first_mm + margin_mm && r < sweep.last_mm - margin_mm && angle < sweep.half_angle &&
           r * std::sin(sweep.half_angle - angle) > margin_mm;
}

}  // namespace

imaging::Sweep tracked_frames(const imaging::Volume& scanned, const Sweep& sweep, const TrackingErrors& errors,
                              Random& random) {
    const double half_width_mm = sweep.last_mm * std::sin(sweep.half_angle);
    const double top_mm = sweep.first_mm * std::cos(sweep.half_angle);
    // Pixels (column, row, mm along the normal) in the frame's own axes.
    Eigen::Affine3d in_frame = Eigen::Affine3d::Identity();
    in_frame.linear() << pixel_mm, 0, 0, 0, 0, -1, 0, pixel_mm, 0;
    in_frame.translation() = Vector3d(-half_width_mm, 0, top_mm);

    const std::vector<Eigen::Isometry3d> places = hand_held(sweep, random);
    const Eigen::Isometry3d calibration = small_motion(errors.calibration_mm, errors.calibration_deg, random);
    imaging::Sweep frames;
    const std::array<int, 3> size{static_cast<int>(places.size()),
                                  static_cast<int>((sweep.last_mm - top_mm) / pixel_mm) + 1,
                                  static_cast<int>(2 * half_width_mm / pixel_mm) + 1};
    frames.pixels = cv::Mat(3, size.data(), CV_8U, cv::Scalar(0));
    const imaging::LinearSampler shown(scanned);
    for (int n = 0; n < size[0]; ++n) {
        const Eigen::Isometry3d& place = places[static_cast<std::size_t>(n)];
        const Eigen::Isometry3d tracked =
            place * small_motion(errors.tracking_mm, errors.tracking_deg, random) * calibration;
        frames.frames.push_back({n, tracked * in_frame});
        tbb::parallel_for(0, size[1], [&](int row) {
            for (int column = 0; column < size[2]; ++column) {
                const Vector3d in_plane = in_frame * Vector3d(column, row, 0);
                if (in_own_fan(sweep, in_plane))
                    frames.pixels.at<std::uint8_t>(n, row, column) =
                        cv::saturate_cast<std::uint8_t>(std::max(1.0, shown.value(place * in_plane)));
            }
        });
    }
    return frames;
}

}  // namespace tissuewarp::study::detail
