#include "core/errors.hpp"
#include "registration/field/rasterisation.hpp"
#include "registration/uncertainty.hpp"

#include <limits>
#include <string>

namespace tissuewarp::registration {

UncertaintyVolumes uncertainty_on_grid(const Uncertainty& uncertainty, const Deformation& deformation,
                                       const imaging::Geometry& fixed_grid) {
    const std::vector<ErrorEstimate> nodal = uncertainty.at_nodes();
    if (Eigen::Index(nodal.size()) != deformation.mesh.nodes.cols())
        throw InvalidInput("the estimate is of " + std::to_string(nodal.size()) + " nodes and the deformation of " +
                           std::to_string(deformation.mesh.nodes.cols()) + "; give those of one registration");
    Eigen::Matrix2Xd values(2, deformation.mesh.nodes.cols());  // deviation; 1 where shown
    for (Eigen::Index n = 0; n < values.cols(); ++n) {
        const ErrorEstimate& estimate = nodal[static_cast<std::size_t>(n)];
        values.col(n) << estimate.deviation_mm, double(estimate.shown);
    }
    UncertaintyVolumes volumes{{fixed_grid, CV_32FC1}, {fixed_grid, CV_8UC1}};
    auto* deviation = volumes.deviation.data<float>();
    auto* trust = volumes.trust.data<unsigned char>();
    std::fill_n(deviation, fixed_grid.voxel_count(), std::numeric_limits<float>::quiet_NaN());
    const Eigen::Matrix3Xd index =
        fixed_grid.point_to_index() * (deformation.deformed_nodes().colwise() - fixed_grid.origin);
    const Eigen::Matrix4Xi& tets = deformation.mesh.tets;
    detail::rasterise(index, tets, fixed_grid.size, [&](int tet, const Eigen::Vector4d& barycentric_step) {
        const Eigen::Matrix<double, 2, 4> corners = values(Eigen::all, tets.col(tet));
        const Eigen::Vector2d step = corners * barycentric_step;
        return [&, corners, step](const detail::TetRow& row) {
            const Eigen::Vector2d start = corners * row.at_first;
            for (int i = row.first; i <= row.last; ++i) {
                const std::int64_t voxel = fixed_grid.size[0] * (row.j + std::int64_t{fixed_grid.size[1]} * row.k) + i;
                const Eigen::Vector2d value = start + step * (i - row.first);
                deviation[voxel] = static_cast<float>(value[0]);
                trust[voxel] = static_cast<unsigned char>(value[1] >= 0.5 ? Trust::Shown : Trust::DoNotTrust);
            }
        };
    });
    return volumes;
}

}  // namespace tissuewarp::registration
