#include "study/detail/registered_phantom.hpp"

#include "registration/field.hpp"

#include <cmath>

namespace tissuewarp::study::detail {

using namespace registration;

double megavoxels(const imaging::Geometry& grid) {
    return double(grid.voxel_count()) / 1e6;
}

Intraoperative seen_of(const Phantom& phantom, DataKind kind) {
    Intraoperative seen;
    if (kind == DataKind::Labels) {
        seen.labels = phantom.fixed_labels;
    } else {
        seen.surface = phantom.surface;
        seen.points = phantom.points;
    }
    return seen;
}

double root_mean_square_error(const Deformation& deformation, const Landmarks& targets) {
    const Eigen::Matrix3Xd off = PointTransform(deformation)(targets.moving) - targets.fixed;
    return std::sqrt(off.colwise().squaredNorm().mean());
}

}  // namespace tissuewarp::study::detail
