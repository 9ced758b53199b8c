#include "imaging/geometry.hpp"

#include "core/errors.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

namespace tissuewarp::imaging {

long long Geometry::voxel_count() const {
    return static_cast<long long>(size[0]) * size[1] * size[2];
}

double Geometry::voxel_volume() const {
    return spacing.prod();
}

Eigen::Vector3d Geometry::point(const Eigen::Vector3d& index) const {
    return origin + direction * spacing.cwiseProduct(index);
}

Eigen::Vector3d Geometry::index(const Eigen::Vector3d& point) const {
    return point_to_index() * (point - origin);
}

Eigen::Matrix3d Geometry::index_to_point() const {
    return direction * spacing.asDiagonal();
}

Eigen::Matrix3d Geometry::point_to_index() const {
    // The inverse, not the transpose: a direction read from a file is orthonormal only to its printed digits.
    return index_to_point().inverse();
}

double grid_distance(const Geometry& a, const Geometry& b) {
    if (a.size != b.size) return std::numeric_limits<double>::infinity();
    const Eigen::Matrix3d to_index = a.point_to_index();
    double largest = 0.0;
    for (int corner = 0; corner < 8; ++corner) {
        Eigen::Vector3d index;
        for (int axis = 0; axis < 3; ++axis) index[axis] = (corner >> axis & 1) ? a.size[axis] - 1 : 0;
        const double distance = (to_index * (b.point(index) - a.point(index))).norm();
        // A comparison with NaN is false, and std::max would drop it: a broken header must not count as near.
        if (!(distance <= largest)) largest = distance;
        if (std::isnan(largest)) return std::numeric_limits<double>::infinity();
    }
    return largest;
}

bool same_grid(const Geometry& a, const Geometry& b, double tolerance) {
    return grid_distance(a, b) <= tolerance;
}

void require_valid(const Geometry& geometry, const char* name) {
    std::ostringstream fault;
    fault.precision(9);
    const double skew = (geometry.direction.transpose() * geometry.direction - Eigen::Matrix3d::Identity())
                            .cwiseAbs()
                            .maxCoeff<Eigen::PropagateNaN>();
    if (*std::min_element(geometry.size.begin(), geometry.size.end()) < 1)
        fault << "size " << geometry.size[0] << " x " << geometry.size[1] << " x " << geometry.size[2]
              << " is not positive; give an image with voxels";
    else if (!geometry.spacing.allFinite() || geometry.spacing.minCoeff() <= 0.0)
        fault << "spacing " << geometry.spacing.transpose()
              << " mm must be positive and finite; correct the voxel size in the header";
    else if (!geometry.origin.allFinite())
        fault << "origin " << geometry.origin.transpose() << " mm is not finite; correct the header";
    else if (!(skew <= 1e-3))
        fault << "direction matrix departs from orthonormal by " << skew
              << ", limit 0.001; resample the image onto axes at right angles";
    else
        return;
    throw InvalidInput(std::string(name) + ": " + fault.str());
}

}  // namespace tissuewarp::imaging
