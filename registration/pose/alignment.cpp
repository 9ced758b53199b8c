#include "registration/pose/alignment.hpp"

#include "core/errors.hpp"
#include "registration/pose/label_distance.hpp"
#include "registration/pose/pose_search.hpp"
#include "registration/pose/surface_pose.hpp"

namespace tissuewarp::registration {

Alignment align_labels(const imaging::Volume& moving_labels, const imaging::Volume& fixed_labels,
                       const AlignmentOptions& options, Observer& observer) {
    const detail::LabelDistance cost(moving_labels.as(CV_32S), fixed_labels.as(CV_32S), options.samples);
    return detail::search_pose(cost, cost.forward.points(), cost.backward.points().rowwise().mean(),
                               detail::PoseFreedom::Similarity, options, observer);
}

Alignment align_surfaces(const meshing::SurfaceMesh& moving, const SurfacePoints& fixed,
                         const AlignmentOptions& options, Observer& observer) {
    if (moving.triangle_count() == 0 || !moving.nodes.allFinite())
        throw InvalidInput("the moving surface has no triangles, or nodes that are not finite");
    const detail::SurfacePose found = detail::search_surface_pose(meshing::SurfaceTree(moving), moving,
                                                                  detail::surface_data(fixed), options, observer);
    return {found.placement, found.typical_distance_mm()};
}

}  // namespace tissuewarp::registration
