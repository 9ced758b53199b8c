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

/// What points of a surface stand for. Chosen by hand; on which data is not recorded.
struct SurfaceDataOptions {
    int most_points = 5000;                           ///< left of them
    double first_cell_mm = 0.25, cell_growth = 1.25;  ///< side of the cells that thin them, and the next over it
    Eigen::Index area_neighbours = 8;                 ///< whose disk tells a point's area
    double most_area = 2;                             ///< over the median area
    Eigen::Index least_neighbours = 16, most_neighbours = 100;  ///< of the plane that tells a normal (Hoppe 1992)
    double normal_deviations = 4;  ///< points within so many deviations are on it, as many as are allowed
};

/// At most `most_points` points, one from each cell of a grid just coarse enough. Normals that are not given are those
/// of the plane through the 16 nearest points or, in dense noisy data, those within four deviations (Hoppe 1992). The
/// area is that of the disk which holds the eight nearest points, over eight, and at most twice its median: a lone
/// point does not weigh more for being alone.
SurfaceData surface_data(const SurfacePoints& surface, int most_points = SurfaceDataOptions().most_points);

}  // namespace tissuewarp::registration::detail
