#pragma once
/// Where the voxels of an image lie in the patient: ITK's origin, spacing and direction, in LPS millimetres.

#include <Eigen/Core>

#include <array>

namespace tissuewarp::imaging {

/// Grid geometry of a three-dimensional image. Index (i, j, k) counts columns, rows, slices; voxel centres lie at
/// integer indices: point = origin + direction * (spacing ∘ index).
struct Geometry {
    std::array<int, 3> size{0, 0, 0};                              ///< voxels along i, j, k
    Eigen::Vector3d origin = Eigen::Vector3d::Zero();              ///< LPS mm, centre of voxel (0, 0, 0)
    Eigen::Vector3d spacing = Eigen::Vector3d::Ones();             ///< mm
    Eigen::Matrix3d direction = Eigen::Matrix3d::Identity();       ///< columns: unit axes i, j, k in LPS

    /// Number of voxels.
    [[nodiscard]] long long voxel_count() const;
    /// Volume of one voxel, mm³.
    [[nodiscard]] double voxel_volume() const;
    /// LPS point (mm) of a continuous index (voxel).
    [[nodiscard]] Eigen::Vector3d point(const Eigen::Vector3d& index) const;
    /// Continuous index (voxel) of an LPS point (mm).
    [[nodiscard]] Eigen::Vector3d index(const Eigen::Vector3d& point) const;
    /// 3×3 matrix A with point = origin + A * index.
    [[nodiscard]] Eigen::Matrix3d index_to_point() const;
    /// Inverse of `index_to_point()`.
    [[nodiscard]] Eigen::Matrix3d point_to_index() const;
};

/// Largest distance, in voxels of `a`, between corresponding grid corners; infinity when the sizes differ.
double grid_distance(const Geometry& a, const Geometry& b);

/// True when the grids agree to `tolerance` voxels at every corner: headers that differ in the seventh digit match.
bool same_grid(const Geometry& a, const Geometry& b, double tolerance = 1e-3);

/// Throws InvalidInput unless size and spacing are positive and finite and the direction is orthonormal to 1e-3
/// (either handedness). `name` stands for the image in the message.
void require_valid(const Geometry& geometry, const char* name);

}  // namespace tissuewarp::imaging
