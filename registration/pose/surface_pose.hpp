#pragma once
/// The rigid placement of a whole surface on points of a part of it.

#include "core/observer.hpp"
#include "meshing/search/surface_tree.hpp"
#include "registration/pose/alignment.hpp"
#include "registration/pose/surface_data.hpp"

#include <algorithm>
#include <cmath>

namespace tissuewarp::registration::detail {

struct SurfacePose {
    Eigen::Isometry3d placement = Eigen::Isometry3d::Identity();  ///< moving → fixed
    double cost = 0;  ///< mean of d²/(d² + s²) over the area of the points, s = `scale_mm`; 1 where no triangle fits
    double scale_mm = 0;    ///< s
    double rival_cost = 1;  ///< of the best placement far from this one
    double rival_mm = 0;    ///< and how far the surface lies from it there, mean over nodes

    /// d at which d²/(d² + s²) is the cost.
    [[nodiscard]] double typical_distance_mm() const { return scale_mm * std::sqrt(cost / std::max(1e-9, 1 - cost)); }
};

/// Starts: the placement that the headers say, and rotations of 25° about twelve axes, each with the middle of the
/// points on places all over the surface that face their way. Each start goes down a symmetric point-to-plane distance
/// (Rusinkiewicz, ACM Trans Graph 38 (2019) 85) under Geman–McClure weights whose scale falls (graduated non-convexity:
/// Yang et al., IEEE RA-L 5 (2020) 1127), with few points at first; the best with more. The cost decides. `surface` is
/// the one in `model`.
SurfacePose search_surface_pose(const meshing::SurfaceTree& model, const meshing::SurfaceMesh& surface,
                                const SurfaceData& data, const AlignmentOptions& options, Observer& observer);

}  // namespace tissuewarp::registration::detail
