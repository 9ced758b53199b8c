#include "registration/evaluation/surface_residual.hpp"

#include "core/errors.hpp"
#include "meshing/search/surface_tree.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

namespace tissuewarp::registration {

SurfaceResidual surface_residual(const meshing::SurfaceMesh& surface, const Eigen::Matrix3Xd& points) {
    constexpr double farthest_mm = 100;
    if (points.cols() == 0 || !points.allFinite())
        throw InvalidInput("surface residual: " + std::to_string(points.cols()) +
                           " points; at least one is needed, all of them finite");
    const meshing::SurfaceTree tree(surface);
    std::vector<double> distances(static_cast<std::size_t>(points.cols())), signs(distances.size());
    tbb::parallel_for(std::size_t{0}, distances.size(), [&](std::size_t n) {
        const Eigen::Vector3d point = points.col(static_cast<Eigen::Index>(n));
        const auto hit = tree.closest(point, std::numeric_limits<double>::infinity());
        distances[n] = hit->distance;
        signs[n] = (point - hit->point).dot(hit->normal) < 0 ? -1 : 1;
    });
    const double nearest = *std::min_element(distances.begin(), distances.end());
    if (nearest > farthest_mm)
        throw InvalidInput("the held-out points lie " + std::to_string(nearest) +
                           " mm or more from the warped surface; coordinates must be LPS mm of the fixed image: for "
                           "RAS, negate x and y");
    const double sum = std::inner_product(distances.begin(), distances.end(), signs.begin(), 0.0);
    const double mean_signed = sum / static_cast<double>(distances.size());
    return {summarise(std::move(distances)), mean_signed};
}

}  // namespace tissuewarp::registration
