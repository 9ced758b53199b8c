#include "core/errors.hpp"
#include "registration/field/rasterisation.hpp"
#include "registration/uncertainty.hpp"

#include <limits>
#include <string>

namespace tissuewarp::registration {

UncertaintyVolumes uncertainty_on_grid(const Uncertainty& uncertainty, const Deformation& deformation,
                                       const imaging::Geometry& fixed_grid) {
    if (uncertainty.mesh().nodes.cols() != deformation.mesh.nodes.cols())
        throw InvalidInput("the estimate is of " + std::to_string(uncertainty.mesh().nodes.cols()) +
                           " nodes and the deformation of " + std::to_string(deformation.mesh.nodes.cols()) +
                           "; give those of one registration");
    UncertaintyVolumes volumes{{fixed_grid, CV_32FC1}, {fixed_grid, CV_8UC1}};
    auto* deviation = volumes.deviation.data<float>();
    auto* trust = volumes.trust.data<unsigned char>();
    std::fill_n(deviation, fixed_grid.voxel_count(), std::numeric_limits<float>::quiet_NaN());
    const Eigen::Matrix3Xd index =
        fixed_grid.point_to_index() * (deformation.deformed_nodes().colwise() - fixed_grid.origin);
    const Eigen::Matrix4Xi& tets = deformation.mesh.tets;
    detail::rasterise(index, tets, fixed_grid.size, [&](int tet, const Eigen::Vector4d& barycentric_step) {
        return [&, tet, barycentric_step](const detail::TetRow& row) {
            for (int i = row.first; i <= row.last; ++i) {
                const std::int64_t voxel = fixed_grid.size[0] * (row.j + std::int64_t{fixed_grid.size[1]} * row.k) + i;
                const ErrorEstimate here = uncertainty.at(tet, row.at_first + barycentric_step * (i - row.first));
                deviation[voxel] = static_cast<float>(here.deviation_mm);
                trust[voxel] = static_cast<unsigned char>(here.trust);
            }
        };
    });
    return volumes;
}

}  // namespace tissuewarp::registration
