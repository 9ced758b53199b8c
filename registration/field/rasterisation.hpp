#pragma once
/// Tetrahedra → the voxels whose centres they hold.

#include <Eigen/Dense>

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace tissuewarp::registration::detail {

/// Voxels first … last of row (j, k) lie in a tetrahedron; `at_first` are the barycentric coordinates of the first.
struct TetRow {
    int first, last, j, k;
    Eigen::Vector4d at_first;
};

struct RasterCount {
    int inverted = 0;  ///< elements of negative volume in voxel indices; they are drawn like the others
    int flat = 0;      ///< elements without volume; they hold no voxel and are skipped
};

/// Barycentric slack, the same as PointLocator's: a centre on a common face belongs to both of its tetrahedra.
constexpr double barycentric_slack = 1e-9;

/// Barycentric coordinates as affine functions of the voxel index: λ = matrix · (index − corner) + (1, 0, 0, 0).
struct BarycentricMap {
    Eigen::Matrix<double, 4, 3> matrix;
    Eigen::Vector3d corner;

    /// Returns the signed volume times six, and 0 where it vanishes against the edges.
    double set(const Eigen::Matrix<double, 3, 4>& corners) {
        corner = corners.col(0);
        const Eigen::Vector3d a = corners.col(1) - corner, b = corners.col(2) - corner, c = corners.col(3) - corner;
        const double volume = a.cross(b).dot(c);
        if (!(std::abs(volume) > 1e-12 * a.norm() * b.norm() * c.norm())) return 0.0;
        matrix.row(1) = b.cross(c) / volume;
        matrix.row(2) = c.cross(a) / volume;
        matrix.row(3) = a.cross(b) / volume;
        matrix.row(0) = -matrix.row(1) - matrix.row(2) - matrix.row(3);
        return volume;
    }

    [[nodiscard]] Eigen::Vector4d at(const Eigen::Vector3d& index) const {
        Eigen::Vector4d lambda = matrix * (index - corner);
        lambda[0] += 1.0;
        return lambda;
    }
};

/// Where a row of voxels may enter and leave a tetrahedron: coordinate c is at_first + step t, and `inverse_step` = 1 /
/// step, which all rows of an element share.
struct RowClip {
    Eigen::Vector4d step, inverse_step;

    explicit RowClip(const Eigen::Vector4d& of_step) : step(of_step), inverse_step(of_step.cwiseInverse()) {}

    /// The part of the voxels [first, last] where all four coordinates stay above −slack; empty when first > last.
    void operator()(const Eigen::Vector4d& at_first, double& first, double& last) const {
        double from = 0.0, to = last - first;
        for (int corner = 0; corner < 4; ++corner) {
            const double excess = at_first[corner] + barycentric_slack;
            const double zero = -excess * inverse_step[corner];
            if (step[corner] > 0.0)
                from = std::max(from, zero);
            else if (step[corner] < 0.0)
                to = std::min(to, zero);
            else if (excess < 0.0)
                to = -1.0;
        }
        if (from > to) {
            last = first - 1.0;
            return;
        }
        last = first + std::floor(to);
        first += std::ceil(from);
    }
};

/// Calls `visit(tet, step)` for tetrahedra, `step` being the change of the barycentric coordinates from a voxel of a
/// row to the next, and what that returns with every TetRow that the tetrahedron holds. `nodes` are continuous voxel
/// indices. Slabs of slices run in parallel; within a slab tetrahedra come in ascending order, so a visitor that keeps
/// the first writer of a voxel gives the same result for any number of threads: the lowest element wins.
template <class Visit>
RasterCount rasterise(const Eigen::Matrix3Xd& nodes, const Eigen::Matrix4Xi& tets, const std::array<int, 3>& size,
                      const Visit& visit) {
    constexpr int slab_slices = 4;
    constexpr double padding = 1e-6;  // voxels; covers the slack of any element shorter than 300 voxels
    const int slabs = (size[2] + slab_slices - 1) / slab_slices;
    std::vector<std::vector<int>> tets_of(static_cast<std::size_t>(slabs));
    RasterCount count;
    const auto bounds = [&](int tet, Eigen::Array3d& first, Eigen::Array3d& last) {
        const Eigen::Matrix<double, 3, 4> corners = nodes(Eigen::all, tets.col(tet));
        first = (corners.rowwise().minCoeff().array() - padding).ceil().max(0.0);
        last = (corners.rowwise().maxCoeff().array() + padding)
                   .floor()
                   .min(Eigen::Array3d(size[0] - 1.0, size[1] - 1.0, size[2] - 1.0));
        return corners;
    };
    struct Reach {
        int sign, first_slab, last_slab;
    };
    std::vector<Reach> reaches(static_cast<std::size_t>(tets.cols()));
    tbb::parallel_for(0, static_cast<int>(tets.cols()), [&](int tet) {
        Eigen::Array3d first, last;
        BarycentricMap map;
        const double volume = map.set(bounds(tet, first, last));
        Reach& reach = reaches[static_cast<std::size_t>(tet)];
        reach = {(volume > 0.0) - (volume < 0.0), 0, -1};
        if (volume == 0.0 || !(first <= last).all()) return;
        reach.first_slab = static_cast<int>(first[2]) / slab_slices;
        reach.last_slab = static_cast<int>(last[2]) / slab_slices;
    });
    for (int tet = 0; tet < static_cast<int>(tets.cols()); ++tet) {
        const Reach& reach = reaches[static_cast<std::size_t>(tet)];
        count.inverted += reach.sign < 0;
        count.flat += reach.sign == 0;
        for (int slab = reach.first_slab; slab <= reach.last_slab; ++slab)
            tets_of[static_cast<std::size_t>(slab)].push_back(tet);
    }
    tbb::parallel_for(0, slabs, [&](int slab) {
        for (const int tet : tets_of[static_cast<std::size_t>(slab)]) {
            Eigen::Array3d lower, upper;
            BarycentricMap map;
            map.set(bounds(tet, lower, upper));
            const RowClip clip(map.matrix.col(0));
            const Eigen::Vector4d at_lower = map.at(lower);
            const auto draw = visit(tet, clip.step);
            const int k_first = std::max(static_cast<int>(lower[2]), slab * slab_slices);
            const int k_last = std::min(static_cast<int>(upper[2]), slab * slab_slices + slab_slices - 1);
            for (int k = k_first; k <= k_last; ++k) {
                const Eigen::Vector4d in_slice = at_lower + map.matrix.col(2) * (k - lower[2]);
                for (int j = static_cast<int>(lower[1]); j <= static_cast<int>(upper[1]); ++j) {
                    const Eigen::Vector4d in_row = in_slice + map.matrix.col(1) * (j - lower[1]);
                    double first = lower[0], last = upper[0];
                    clip(in_row, first, last);
                    if (!(first <= last)) continue;
                    draw(TetRow{static_cast<int>(first), static_cast<int>(last), j, k,
                                in_row + clip.step * (first - lower[0])});
                }
            }
        }
    });
    return count;
}

}  // namespace tissuewarp::registration::detail
