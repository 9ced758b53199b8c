#pragma once

#include "imaging/volume.hpp"

#include <Eigen/Dense>

namespace tissuewarp::meshing {

inline imaging::Geometry grid(int n, const Eigen::Vector3d& spacing = Eigen::Vector3d::Ones()) {
    imaging::Geometry geometry;
    geometry.size = {n, n, n};
    geometry.spacing = spacing;
    return geometry;
}

/// Rotation by 30° about an oblique axis.
inline Eigen::Matrix3d oblique() {
    return Eigen::AngleAxisd(0.5236, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
}

/// Calls `label(point)` with the LPS point of each voxel.
template <class Label>
imaging::Volume paint(const imaging::Geometry& geometry, const Label& label) {
    imaging::Volume volume(geometry, CV_32SC1);
    for (int k = 0; k < geometry.size[2]; ++k)
        for (int j = 0; j < geometry.size[1]; ++j)
            for (int i = 0; i < geometry.size[0]; ++i)
                volume.data<int>()[volume.offset(i, j, k)] = label(geometry.point(Eigen::Vector3d(i, j, k)));
    return volume;
}

/// Ball of radius 9 mm, label 7, inside a ball of radius 18 mm, label 3, about `centre`.
inline auto two_balls(const Eigen::Vector3d& centre) {
    return [centre](const Eigen::Vector3d& p) {
        const double r = (p - centre).norm();
        return r < 9.0 ? 7 : r < 18.0 ? 3 : 0;
    };
}

}  // namespace tissuewarp::meshing
