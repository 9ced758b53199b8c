#include "registration/field/parted.hpp"

#include "core/errors.hpp"
#include "imaging/filters.hpp"
#include "registration/field/held_bodies.hpp"
#include "registration/field/mesh_labels.hpp"
#include "registration/field/voxel_jacobian.hpp"

#include <tbb/parallel_for.h>

namespace tissuewarp::registration {

using imaging::Volume;

Volume parted_after(const Deformation& deformation, const Volume& fixed_to_moving) {
    if (fixed_to_moving.voxels.type() != CV_32FC3)
        throw InvalidInput("parted tissue: the field must have three channels of float32; give a displacement field");
    const imaging::Geometry& grid = fixed_to_moving.geometry;
    Volume organ = mask_of_mesh(deformation.deformed_mesh(), grid);
    if (deformation.surroundings && deformation.surroundings->slide)  // differences across the jump say nothing
        organ = imaging::dilate(organ, grid.spacing.maxCoeff());
    const detail::HeldBodies rigid = detail::held_after(deformation);
    const Eigen::Isometry3d to_rigid = deformation.far_motion().inverse();
    const detail::VoxelJacobian jacobian(fixed_to_moving);
    Volume parted(grid, CV_8UC1);
    tbb::parallel_for(0, grid.size[2], [&](int k) {
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i) {
                const std::int64_t voxel = parted.offset(i, j, k);
                if (organ.data<std::uint8_t>()[voxel] || jacobian.determinant({i, j, k}) * most_stretch_of_volume >= 1)
                    continue;
                parted.data<std::uint8_t>()[voxel] = rigid.at(to_rigid * grid.point(Eigen::Vector3d(i, j, k))) == 0;
            }
    });
    return parted;
}

}  // namespace tissuewarp::registration
