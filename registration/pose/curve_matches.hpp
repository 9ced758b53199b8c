#pragma once
/// Which places of lines belong to which points.

#include "meshing/search/curve_tree.hpp"

#include <Eigen/Geometry>

#include <vector>

namespace tissuewarp::registration::detail {

/// A point of the fixed frame and the nearest place on the lines, as the model has them.
struct CurveMatch {
    bool found = false;
    meshing::CurveTree::Hit hit;                       ///< moving frame
    Eigen::Vector3d across = Eigen::Vector3d::Zero();  ///< from the line to the point, normal to the line, mm
};

/// The points made ready, fixed frame.
struct CurvePoints {
    Eigen::Matrix3Xd points, tangents;  ///< 3 × P, LPS mm; unit, or 0 where not known
    Eigen::VectorXd shares;             ///< P: 1 over the number of points that say one thing together
    double deviation_mm = 1;

    [[nodiscard]] Eigen::Index count() const { return points.cols(); }
};

/// Every point with its nearest place within `reach_mm`, where the tangents agree within an angle.
std::vector<CurveMatch> match_curves(const meshing::CurveTree& lines, const CurvePoints& points,
                                     const Eigen::Isometry3d& placement, double reach_mm, double max_angle_deg);

/// Median distance of the points that have a match; infinity where none has.
double median_distance(const std::vector<CurveMatch>& matches);

}  // namespace tissuewarp::registration::detail
