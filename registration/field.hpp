#pragma once
/// Displacement fields on image grids, in both directions.
///
/// Inside the mesh the forward field is the finite-element field, and the backward field its exact inverse: the
/// deformed tetrahedra are rasterised over the grid and each voxel centre is carried back through its barycentric
/// coordinates. Outside the mesh both continue it: equal to the field on the surface, and from there smoothly
/// (harmonically where it is gentle, with less slope where that would fold) into the rigid placement, reached `fade_mm`
/// away from the organ. There the backward field inverts the forward one numerically, to about 0.01 mm where the field
/// does not fold. Where the surroundings' motion is known (Deformation::surroundings) that motion takes the place of
/// the placement, rigid ones move by it but for 2.5 mm at their edges, and the backward field is continued on its own:
/// tissue that parts from bone leaves places to which no preoperative point comes. Where the organ slid along them
/// (Surroundings::slide) both continue the motion of its surface across itself instead, beyond a layer of 4 mm that
/// shears.

#include "core/observer.hpp"
#include "imaging/volume.hpp"
#include "registration/deformation.hpp"

#include <memory>

namespace tissuewarp::registration {

struct FieldOptions {
    double fade_mm = 60.0;  ///< distance from the mesh at which only the rigid placement is left
};

/// Where preoperative points go: y − X on a grid of the moving image, three channels float32, LPS mm.
imaging::Volume displacement_moving_to_fixed(const Deformation& deformation, const imaging::Geometry& moving_grid,
                                             const FieldOptions& options = {}, Observer& observer = silent_observer());

/// The same near the organ alone, for what looks a few voxels beyond its surface: voxels within `reach` steps of the
/// mesh continue what lies next to them, and farther ones move with the placement. Costs a fraction of the
/// continuation.
imaging::Volume displacement_near_mesh(const Deformation& deformation, const imaging::Geometry& moving_grid, int reach);

/// Where intraoperative points came from: X − y on a grid of the fixed image, three channels float32, LPS mm; what
/// ITK's, ANTs' and elastix' resamplers take.
imaging::Volume displacement_fixed_to_moving(const Deformation& deformation, const imaging::Geometry& fixed_grid,
                                             const FieldOptions& options = {}, Observer& observer = silent_observer());

/// The forward map at arbitrary points, the continuation included, which is made for the first that needs it.
class PointTransform {
public:
    explicit PointTransform(const Deformation& deformation, const FieldOptions& options = {});
    ~PointTransform();
    PointTransform(PointTransform&&) noexcept;
    PointTransform& operator=(PointTransform&&) noexcept;

    /// y for points X of the moving frame, 3 × P.
    [[nodiscard]] Eigen::Matrix3Xd operator()(const Eigen::Matrix3Xd& points) const;
    /// Whether each point lies in the mesh, where the map is the simulation's and not the continuation's.
    [[nodiscard]] std::vector<bool> inside(const Eigen::Matrix3Xd& points) const;

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// What was changed so that a field does not fold.
struct Unfolding {
    std::int64_t voxels = 0;      ///< whose displacement is another
    std::int64_t left = 0;        ///< that are folded nevertheless: det ≤ 0
    std::int64_t in_organ = 0;    ///< of these in the mesh, but not beside a surface along which it slides on itself
    double most_in_organ_mm = 0;  ///< largest of their changes
    std::int64_t sliding = 0;     ///< of these in tetrahedra at such a surface
    std::int64_t organ = 0;       ///< voxels in the mesh
};

/// Take the folds out of a field, in place: voxels about those with det(∂y/∂X) ≤ 0.05 take the mean of their six
/// neighbours again and again (Laplacian smoothing), beside the mesh and rigid surroundings first. Where that does not
/// do, since parts of the mesh pass into each other, these and the mesh's outermost voxels do too, and at last all near
/// a fold. Differences are central ones, over two voxels: beside what slid far, interpolation within a voxel may fold.
/// A field without folds is not touched, nor one that folds in a twentieth of its voxels. PointTransform, which
/// has no voxels, does not follow.
Unfolding unfold_moving_to_fixed(imaging::Volume& field, const Deformation& deformation);
Unfolding unfold_fixed_to_moving(imaging::Volume& field, const Deformation& deformation);

/// det(∂y/∂X) of a forward field, or the like of a backward one, by central differences, one channel float32 (one-sided
/// at the border of the grid).
imaging::Volume jacobian_determinant(const imaging::Volume& displacement);

}  // namespace tissuewarp::registration
