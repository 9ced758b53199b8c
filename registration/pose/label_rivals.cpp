#include "registration/pose/label_rivals.hpp"

#include "registration/pose/label_distance.hpp"
#include "registration/pose/pose_search.hpp"
#include "registration/pose/rival_poses.hpp"

#include <algorithm>
#include <limits>

namespace tissuewarp::registration::detail {

bool is_better_rival(double rival_mm, double than_mm) {
    return rival_mm < label_rival_options.better * than_mm && rival_mm < than_mm - label_rival_options.better_mm;
}

LabelRivals label_rivals(LabelBoundaries& moving, LabelBoundaries& fixed, const Eigen::Isometry3d& placement,
                         const AlignmentOptions& options, Observer& observer) {
    const LabelDistance distance(moving, fixed, label_rival_options.samples);
    const Eigen::Matrix3Xd& points = distance.forward.points();
    const Eigen::Vector3d centre = points.rowwise().mean(), fixed_centre = distance.backward.points().rowwise().mean();
    LabelRivals rivals;
    rivals.turned_mm = rivals.mirrored_mm = std::numeric_limits<double>::infinity();
    for (const Eigen::Matrix3d& symmetry : symmetries_of_a_cube()) {
        Eigen::Affine3d about_centre = Eigen::Affine3d::Identity();
        about_centre.linear() = symmetry;
        about_centre.translation() = centre - symmetry * centre;
        const Eigen::Affine3d start = placement * about_centre;
        const auto cost = [&](const Eigen::Affine3d& map, double trim, int stride) {
            return distance(map * start, trim, stride);
        };
        const Eigen::Matrix3Xd started = start * points;
        const Alignment found = search_pose(cost, started, fixed_centre, PoseFreedom::Similarity, options, observer);
        if (symmetry.isIdentity()) {
            rivals.found_mm = found.mean_distance_mm;
        } else if (symmetry.determinant() < 0) {
            rivals.mirrored_mm = std::min(rivals.mirrored_mm, found.mean_distance_mm);
        } else if (found.mean_distance_mm < rivals.turned_mm) {
            rivals.turned_mm = found.mean_distance_mm;
            rivals.turned = found.placement * Eigen::Isometry3d(start.matrix());
            const Eigen::Matrix3d turn = placement.linear().transpose() * rivals.turned.linear();
            rivals.turned_deg = Eigen::AngleAxisd(turn).angle() * 180 / EIGEN_PI;
        }
    }
    return rivals;
}

}  // namespace tissuewarp::registration::detail
