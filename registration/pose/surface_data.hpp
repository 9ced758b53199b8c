#pragma once
/// Points of an intraoperative surface, made ready: thinned, with normals, and with the area that each stands for.

#include "registration/intraoperative.hpp"

namespace tissuewarp::registration::detail {

struct SurfaceData {
    Eigen::Matrix3Xd points;   ///< 3 × P, LPS mm, fixed frame
    Eigen::Matrix3Xd normals;  ///< 3 × P, unit
    Eigen::VectorXd areas;     ///< P, mm²
    bool oriented = true;      ///< false: the sign of the normals is not known
    double deviation_mm = 1;

    [[nodiscard]] Eigen::Index count() const { return points.cols(); }
};

/// At most `most_points` points, one from each cell of a grid just coarse enough. Normals that are not given are those
/// of the plane through the 16 nearest points or, in dense noisy data, those within four deviations (Hoppe 1992). The
/// area is that of the disk which holds the eight nearest points, over eight, and at most twice its median: a lone
/// point does not weigh more for being alone.
SurfaceData surface_data(const SurfacePoints& surface, int most_points = 5000);

}  // namespace tissuewarp::registration::detail
