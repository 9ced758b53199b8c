#include "registration/pose/surface_data.hpp"

#include "meshing/search/point_tree.hpp"
#include "registration/io/surface_points.hpp"

#include <tbb/parallel_for.h>
#include <Eigen/Eigenvalues>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <vector>

namespace tissuewarp::registration::detail {

namespace {

/// Indices of points, the first of each cell.
std::vector<Eigen::Index> one_per_cell(const Eigen::Matrix3Xd& points, double side) {
    const Eigen::Vector3d lower = points.rowwise().minCoeff();
    std::set<std::array<long long, 3>> taken;
    std::vector<Eigen::Index> kept;
    for (Eigen::Index n = 0; n < points.cols(); ++n) {
        const Eigen::Array3d cell = ((points.col(n) - lower) / side).array().floor();
        if (taken
                .insert(
                    {static_cast<long long>(cell[0]), static_cast<long long>(cell[1]), static_cast<long long>(cell[2])})
                .second)
            kept.push_back(n);
    }
    return kept;
}

std::vector<Eigen::Index> thinned(const Eigen::Matrix3Xd& points, int most) {
    std::vector<Eigen::Index> kept(static_cast<std::size_t>(points.cols()));
    for (std::size_t n = 0; n < kept.size(); ++n) kept[n] = static_cast<Eigen::Index>(n);
    for (double side = SurfaceDataOptions().first_cell_mm; kept.size() > static_cast<std::size_t>(most);
         side *= SurfaceDataOptions().cell_growth)
        kept = one_per_cell(points, side);
    return kept;
}

Eigen::Vector3d plane_normal(const Eigen::Matrix3Xd& points) {
    const Eigen::Matrix3Xd centred = points.colwise() - points.rowwise().mean();
    return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(centred * centred.transpose()).eigenvectors().col(0);
}

}  // namespace

SurfaceData surface_data(const SurfacePoints& surface, int most_points) {
    require_usable(surface);
    constexpr SurfaceDataOptions rules;
    constexpr Eigen::Index area_neighbours = rules.area_neighbours, least_neighbours = rules.least_neighbours,
                           most_neighbours = rules.most_neighbours;
    const std::vector<Eigen::Index> kept = thinned(surface.points, most_points);
    SurfaceData data;
    data.points = surface.points(Eigen::all, kept);
    data.deviation_mm = surface.deviation_mm;
    data.oriented = surface.normals.cols() > 0;
    if (data.oriented)
        data.normals = surface.normals(Eigen::all, kept).colwise().normalized();
    else
        data.normals.resize(3, data.count());
    data.areas.resize(data.count());
    const double within = std::pow(rules.normal_deviations * surface.deviation_mm, 2);
    const Eigen::Index sorted = std::min(most_neighbours + 1, data.count());
    const meshing::PointTree tree(data.points);
    tbb::parallel_for(Eigen::Index{0}, data.count(), [&](Eigen::Index n) {
        const auto nearest = tree.nearest(data.points.col(n), static_cast<std::size_t>(sorted));
        const auto area_count = std::min(area_neighbours, sorted - 1);
        data.areas[n] = EIGEN_PI * nearest[static_cast<std::size_t>(area_count)].squared_distance / double(area_count);
        if (data.oriented) return;
        std::vector<int> around;
        for (Eigen::Index k = 0; k < sorted; ++k) {
            const auto& [squared, index] = nearest[static_cast<std::size_t>(k)];
            if (k < least_neighbours || squared < within) around.push_back(index);
        }
        data.normals.col(n) = plane_normal(data.points(Eigen::all, around));
    });
    std::vector<double> areas(data.areas.begin(), data.areas.end());
    std::nth_element(areas.begin(), areas.begin() + data.count() / 2, areas.end());
    data.areas = data.areas.cwiseMin(rules.most_area * areas[areas.size() / 2]);
    return data;
}

}  // namespace tissuewarp::registration::detail
