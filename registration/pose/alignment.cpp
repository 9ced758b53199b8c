#include "registration/pose/alignment.hpp"

#include "core/errors.hpp"
#include "registration/pose/label_distance.hpp"
#include "registration/pose/label_rivals.hpp"
#include "registration/pose/pose_search.hpp"
#include "registration/pose/surface_pose.hpp"

namespace tissuewarp::registration {

Alignment align_labels(const imaging::Volume& moving_labels, const imaging::Volume& fixed_labels,
                       const AlignmentOptions& options, Observer& observer) {
    detail::LabelBoundaries moving(moving_labels), fixed(fixed_labels);
    return detail::align_labels(moving, fixed, options, observer);
}

Alignment detail::align_labels(LabelBoundaries& moving, LabelBoundaries& fixed, const AlignmentOptions& options,
                               Observer& observer) {
    const LabelDistance cost(moving, fixed, options.samples);
    const Eigen::Vector3d fixed_centroid = cost.backward.points().rowwise().mean();
    const auto search_from = [&](const Eigen::Isometry3d& start) -> Alignment {
        const auto moved_on = [&](const Eigen::Affine3d& map, double trim, int stride) {
            return cost(map * Eigen::Affine3d(start.matrix()), trim, stride);
        };
        const Alignment found = search_pose(moved_on, start * cost.forward.points(), fixed_centroid,
                                            PoseFreedom::Similarity, options, observer);
        return {found.placement * start, found.mean_distance_mm};
    };
    const Alignment found = search_from(Eigen::Isometry3d::Identity());
    if (found.mean_distance_mm < label_rival_options.look_above_mm) return found;
    const LabelRivals rivals = label_rivals(moving, fixed, found.placement, options, observer);
    if (!is_better_rival(rivals.turned_mm, rivals.found_mm)) return found;
    return search_from(rivals.turned);
}

Alignment align_surfaces(const meshing::SurfaceMesh& moving, const SurfacePoints& fixed,
                         const AlignmentOptions& options, Observer& observer) {
    if (moving.triangle_count() == 0 || !moving.nodes.allFinite())
        throw InvalidInput("the moving surface has no triangles, or nodes that are not finite");
    const detail::SurfacePose found = detail::search_surface_pose(meshing::SurfaceTree(moving), moving,
                                                                  detail::surface_data(fixed), options, observer);
    return {found.pose.chosen.placement, found.pose.chosen.typical_distance_mm(found.scale_mm)};
}

}  // namespace tissuewarp::registration
