#pragma once
/// Maps of points as displacement fields, their linear parts, and their inverses. LPS mm throughout.

#include "imaging/vector_sampling.hpp"
#include "registration/io/point_map.hpp"

#include <Eigen/Geometry>

#include <cstdint>
#include <optional>

namespace tissuewarp::registration {

/// Evaluates a map. Beyond the grid of its field (half a voxel about the outermost centres) the field is zero, as in
/// itk::DisplacementFieldTransform. Safe to call from many threads.
class MappedPoint {
public:
    explicit MappedPoint(const PointMap& map);
    [[nodiscard]] Eigen::Vector3d operator()(const Eigen::Vector3d& point) const;

private:
    Eigen::Affine3d before_, after_;
    std::optional<imaging::VectorSampler> field_;
};

/// Where the map takes the voxels of a grid, less where they lie: three channels float32.
imaging::Volume displacement_on(const PointMap& map, const imaging::Geometry& grid);

/// Gives the vectors of the field that is left of displacements y ↦ y + d(y) where a linear map follows it:
/// linear (y + vector(y)) = y + d(y). Refers to `displacement`. Throws InvalidInput where the linear map is singular.
class WithoutLinearPart {
public:
    WithoutLinearPart(const imaging::Volume& displacement, const Eigen::Affine3d& linear);
    /// Of voxels `first` to `first` + `count` (x fastest), three components each.
    void operator()(std::int64_t first, std::int64_t count, float* vectors) const;

private:
    const imaging::Volume* displacement_;
    Eigen::Affine3d back_;
};

/// The same map as y ↦ linear (y + field(y)), the field on the grid of the displacements.
PointMap with_linear_part(const imaging::Volume& displacement, const Eigen::Affine3d& linear);

/// The grid on which a map can be written as a field without interpolation: that of its own field, turned back by what
/// is applied before; nothing where the map is linear, or where that would skew or stretch the grid.
std::optional<imaging::Geometry> own_grid(const PointMap& map);

/// The linear map that comes closest (least squares over the grid of the field) and how far it is from the map there.
struct NearestLinear {
    Eigen::Affine3d map = Eigen::Affine3d::Identity();
    double furthest_mm = 0;
};
NearestLinear nearest_linear(const PointMap& map);

/// How far places may be from where the map takes them back, mm.
inline constexpr double inverse_tolerance_mm = 0.001;

/// The inverse, with a field on `grid`, which lies where the map leads to, where there is one in the map; beyond its
/// own grid the map's field is continued by its outermost vectors. Exact for a linear map; otherwise to
/// inverse_tolerance_mm at the voxels of `grid`. Throws InvalidInput where the linear part is singular, and where the
/// map cannot be inverted, as where it folds, with place and number of such voxels.
PointMap inverse_on(const PointMap& map, const imaging::Geometry& grid);

/// Of a linear map. Throws InvalidInput where it has a field or is singular.
PointMap inverse_of_linear(const PointMap& map);

}  // namespace tissuewarp::registration
