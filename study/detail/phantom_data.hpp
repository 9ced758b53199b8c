#pragma once
/// What is seen of a deformed organ: drawn labels, points of a part of its surface, pairs of points.

#include "study/detail/quadratic_map.hpp"
#include "study/detail/random.hpp"

#include "imaging/volume.hpp"
#include "registration/evaluation.hpp"
#include "registration/intraoperative.hpp"
#include "study/detail/true_tissue.hpp"
#include "study/detail/truth.hpp"

#include <Eigen/Geometry>

#include <optional>

namespace tissuewarp::study::detail {

/// The deformed organ in the fixed frame.
struct DeformedOrgan {
    const TruthMesh& mesh;
    Eigen::Matrix3Xd nodes;  ///< of the quadratic mesh, 3 × N mm, fixed frame
};

/// Labels of the deformed organ on a grid of its own orientation, its boundary shifted by smooth noise of a correlation
/// length of 10 mm whose deviation along every direction is `boundary_deviation_mm`.
imaging::Volume drawn_labels(const DeformedOrgan& organ, double voxel_mm, double boundary_deviation_mm, Random& random);

/// Points of the part of the surface that faces one way (none: any), a share of `share` of its area, with noise along
/// each axis; 3 % are anywhere within 15 mm of where they belong.
registration::SurfacePoints seen_surface(const DeformedOrgan& organ, double share, double deviation_mm, Random& random,
                                         const std::optional<Eigen::Vector3d>& facing = {});

/// Of tissue that is known by its maps alone.
imaging::Volume drawn_labels(const TrueTissue& tissue, double voxel_mm, double boundary_deviation_mm, Random& random);
registration::SurfacePoints seen_surface(const TrueTissue& tissue, double share, double deviation_mm, Random& random);
/// Points spread evenly over the surface at rest, about one per `mm2`, where they went: 3 × P mm, fixed frame.
Eigen::Matrix3Xd surface_samples(const TrueTissue& tissue, double mm2, Random& random);

/// A grid along `direction` that holds points with some margin.
imaging::Geometry random_grid(const Eigen::Matrix3Xd& points, const Eigen::Matrix3d& direction, double voxel_mm,
                              Random& random);

/// Up to eight smooth lines through the organ, and points of 60 % of each with noise along each axis.
registration::Curves vessels(const TrueTissue& tissue, double deviation_mm, Random& random);

/// Random places inside, at least `depth_mm` under the surface, and where they went.
registration::Landmarks places(const TrueTissue& tissue, int count, double depth_mm, Random& random);

/// The same with noise on the fixed side.
registration::PointPairs found_again(registration::Landmarks places, double deviation_mm, Random& random);

}  // namespace tissuewarp::study::detail
