#pragma once
/// The warp during the operation, on a GPU: image, mesh and grid stay on the device, displacements of the nodes go up,
/// the warped image comes down.
///
/// The deformed tetrahedra are rasterised over the output grid, as in displacement_fixed_to_moving(): a voxel belongs
/// to the lowest element that holds its centre, folded elements included, and is carried back through its barycentric
/// coordinates. Inside the mesh this is the exact inverse of the finite-element field to float32: within 1e-4 mm of
/// displacement_fixed_to_moving() on grids of a few hundred voxels an axis. A voxel centre within 1e-4 voxels of the
/// surface may fall on either side of it, where the continuation differs by up to its own error, about 0.01 mm. A
/// device repeats itself bit by bit.
///
/// Outside the mesh there is nothing to carry back through. There the field is the one that set_continuation() was
/// given last: the continuation solved on the CPU, which takes a second, not milliseconds. Given for the very
/// deformation, the result is that of displacement_fixed_to_moving() and warp_image(); given for an earlier one, the
/// outside lags behind, with a step at the surface of what the surface moved since. Without one, voxels outside follow
/// the placement alone.

#include "imaging/filters.hpp"
#include "imaging/volume.hpp"
#include "meshing/tet_mesh.hpp"

#include <Eigen/Geometry>

#include <memory>
#include <string>

namespace tissuewarp::registration {

struct GpuWarpOptions {
    int gpu_index = -1;  ///< EGL device, −1: the first with hardware, or software where there is none
    imaging::Interpolation interpolation = imaging::Interpolation::Linear;  ///< Nearest for labels
    double outside = 0.0;  ///< value of voxels whose tissue lay outside the moving image, saturated to its type
};

/// What the last call did.
struct GpuWarpReport {
    /// Seconds of the device without transfers: voxels to elements, then the moving image, or the field, at every
    /// voxel. Mesa's llvmpipe does not count compute and gives 0.
    double rasterise_seconds = 0, resample_seconds = 0;
    int inverted = 0;  ///< elements of negative volume: the field folds there
    int flat = 0;      ///< elements without volume to float32; they hold no voxel
};

class GpuWarp {
public:
    /// `mesh`: rest positions, LPS mm, frame of the moving image. `moving`: one channel of 8 or 16 bits or float32;
    /// with Nearest integers of up to 32 bits. The result lies on `output`, a grid of the fixed frame, and has the type
    /// of `moving`. Throws InvalidInput, and GpuUnavailable without a device, where a grid exceeds its storage block (4
    /// bytes a voxel; 128 MiB on Mesa's llvmpipe), and where a trial on the very mesh and image differs from the CPU.
    GpuWarp(const meshing::TetMesh& mesh, const imaging::Volume& moving, const imaging::Geometry& output,
            const GpuWarpOptions& options = {});
    ~GpuWarp();
    GpuWarp(GpuWarp&&) noexcept;
    GpuWarp& operator=(GpuWarp&&) noexcept;

    /// Keeps the field for voxels outside the mesh: X − y in mm on the output grid, from displacement_fixed_to_moving()
    /// for a deformation with this placement. Later placements move it along. Throws InvalidInput for another grid or
    /// values that are not finite.
    void set_continuation(const imaging::Volume& fixed_to_moving,
                          const Eigen::Isometry3d& placement = Eigen::Isometry3d::Identity());

    /// The moving image carried by y = placement · (X + u(X)), `displacement` = u at the nodes, 3 × N, mm, moving
    /// frame. Throws InvalidInput for another number of nodes and values that are not finite, GpuUnavailable when the
    /// device fails.
    [[nodiscard]] imaging::Volume warp(const Eigen::Matrix3Xd& displacement,
                                       const Eigen::Isometry3d& placement = Eigen::Isometry3d::Identity());
    /// The same into a volume that an earlier call returned, whose memory is used again.
    void warp(const Eigen::Matrix3Xd& displacement, const Eigen::Isometry3d& placement, imaging::Volume& result);

    /// The field by which warp() pulls: X − y on the output grid, three channels float32, LPS mm.
    [[nodiscard]] imaging::Volume field(const Eigen::Matrix3Xd& displacement,
                                        const Eigen::Isometry3d& placement = Eigen::Isometry3d::Identity());

    [[nodiscard]] const GpuWarpReport& report() const;
    /// The device's name.
    [[nodiscard]] const std::string& device() const;

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace tissuewarp::registration
