#include "registration/resection/cavity_wall.hpp"

#include "imaging/labels.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace tissuewarp::registration::detail {

int label_at(const imaging::Volume& labels, const Eigen::Vector3d& point) {
    const Eigen::Vector3d index = labels.geometry.index(point);
    std::array<int, 3> voxel{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        voxel[axis] = static_cast<int>(std::lround(index[static_cast<Eigen::Index>(axis)]));
        if (voxel[axis] < 0 || voxel[axis] >= labels.geometry.size[axis]) return 0;
    }
    return labels.data<std::int32_t>()[labels.offset(voxel[0], voxel[1], voxel[2])];
}

void mark_cavity_wall(Interfaces& interfaces, const meshing::TetMesh& mesh, const imaging::Volume& resected) {
    const double step = 0.5 * resected.geometry.spacing.minCoeff(),
                 beyond = std::max(cavity_wall_options.beyond_mm,
                                   cavity_wall_options.beyond_voxels * resected.geometry.spacing.maxCoeff());
    for (InterfaceNode& node : interfaces.nodes()) {
        if (node.outer != 0) continue;
        for (double s = 0; s <= beyond && !node.at_cavity; s += step)
            node.at_cavity = label_at(resected, mesh.nodes.col(node.node) + s * node.normal) != 0;
    }
}

imaging::Volume all_but(const imaging::Volume& labels) {
    return {labels.geometry, cv::Mat(imaging::mask_of_all(labels).voxels == 0)};
}

}  // namespace tissuewarp::registration::detail
