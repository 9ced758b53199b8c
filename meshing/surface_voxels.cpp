#include "meshing/surface_voxels.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace tissuewarp::meshing {

namespace {

/// Rays run along the voxels' rows, a hair beside their centres, where no node of a file lies.
constexpr double beside_j = 1.1e-7, beside_k = 1.7e-7;  // voxels

/// Twice the signed area of (a, b, p) in the plane across the rows, the same number with the other sign for (b, a, p):
/// neighbours that share an edge never both take a ray, nor both leave it.
double side(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double j, double k) {
    const bool ordered = a[1] < b[1] || (a[1] == b[1] && a[2] < b[2]);
    const Eigen::Vector3d &p = ordered ? a : b, &q = ordered ? b : a;
    const double area = (q[1] - p[1]) * (k - p[2]) - (q[2] - p[2]) * (j - p[1]);
    return ordered == (area >= 0) ? std::abs(area) : -std::abs(area);
}

/// Where rays along i cross one triangle, corners in voxels: calls visit(i, j, k).
template <class Visit>
void cross(const std::array<Eigen::Vector3d, 3>& corners, const std::array<int, 3>& size, const Visit& visit) {
    const auto range = [&](int axis, double beside) {
        const auto [low, high] = std::minmax({corners[0][axis], corners[1][axis], corners[2][axis]});
        return std::pair(std::max(0, static_cast<int>(std::ceil(std::max(-1.0, low - beside)))),
                         std::min(size[static_cast<std::size_t>(axis)] - 1,
                                  static_cast<int>(std::floor(std::min(1e9, high - beside)))));
    };
    const auto [first_j, last_j] = range(1, beside_j);
    const auto [first_k, last_k] = range(2, beside_k);
    for (int k = first_k; k <= last_k; ++k)
        for (int j = first_j; j <= last_j; ++j) {
            std::array<double, 3> weight{};
            for (std::size_t c = 0; c < 3; ++c)
                weight[c] = side(corners[(c + 1) % 3], corners[(c + 2) % 3], j + beside_j, k + beside_k);
            const int positive = !std::signbit(weight[0]) + !std::signbit(weight[1]) + !std::signbit(weight[2]);
            const double sum = weight[0] + weight[1] + weight[2];
            if ((positive != 0 && positive != 3) || sum == 0) continue;
            visit((weight[0] * corners[0][0] + weight[1] * corners[1][0] + weight[2] * corners[2][0]) / sum, j, k);
        }
}

void fill_row(std::uint8_t* row, int length, std::vector<double>& crossings) {
    std::sort(crossings.begin(), crossings.end());
    for (std::size_t n = 0; n + 1 < crossings.size(); n += 2) {
        const int first = static_cast<int>(std::ceil(std::clamp(crossings[n], 0.0, double(length))));
        const int past = static_cast<int>(std::ceil(std::clamp(crossings[n + 1], 0.0, double(length))));
        std::fill(row + first, row + past, std::uint8_t{1});
    }
}

}  // namespace

imaging::Geometry grid_about(const ClosedSurface& surface, const SurfaceGridOptions& options) {
    const Eigen::Vector3d lower = surface.mesh.nodes.rowwise().minCoeff(),
                          upper = surface.mesh.nodes.rowwise().maxCoeff();
    const double margin = options.margin * (upper - lower).maxCoeff();
    const Eigen::Vector3d extent = (upper - lower).array() + 2 * margin;
    const double body = surface.volume_mm3 > 0 ? surface.volume_mm3 : (upper - lower).prod() / 2;
    const double spacing =
        std::max(std::cbrt(body) / options.voxels_across, std::cbrt(extent.prod() / options.most_voxels));
    imaging::Geometry grid;
    grid.spacing.setConstant(spacing);
    grid.origin = lower.array() - margin;
    for (std::size_t axis = 0; axis < 3; ++axis)
        grid.size[axis] = static_cast<int>(std::ceil(extent[static_cast<Eigen::Index>(axis)] / spacing)) + 1;
    return grid;
}

imaging::Volume voxels_inside(const SurfaceMesh& surface, const imaging::Geometry& grid) {
    const auto [ni, nj, nk] = grid.size;
    std::vector<std::vector<double>> crossings(static_cast<std::size_t>(nj) * static_cast<std::size_t>(nk));
    const Eigen::Matrix3Xd indices = grid.point_to_index() * (surface.nodes.colwise() - grid.origin);
    for (Eigen::Index t = 0; t < surface.triangles.cols(); ++t) {
        const auto corner = [&](int k) -> Eigen::Vector3d { return indices.col(surface.triangles(k, t)); };
        cross({corner(0), corner(1), corner(2)}, grid.size, [&](double i, int j, int k) {
            crossings[static_cast<std::size_t>(j) + static_cast<std::size_t>(nj) * static_cast<std::size_t>(k)]
                .push_back(i);
        });
    }
    imaging::Volume inside(grid, CV_8U);
    for (std::size_t row = 0; row < crossings.size(); ++row)
        fill_row(inside.data<std::uint8_t>() + static_cast<std::int64_t>(row) * ni, ni, crossings[row]);
    return inside;
}

}  // namespace tissuewarp::meshing
