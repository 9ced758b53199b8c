#include "registration/field/mesh_labels.hpp"

#include "registration/field/rasterisation.hpp"

namespace tissuewarp::registration {

imaging::Volume labels_of_mesh(const meshing::TetMesh& mesh, const imaging::Geometry& grid) {
    imaging::Volume labels(grid, CV_32SC1);
    auto* voxels = labels.data<std::int32_t>();
    const Eigen::Matrix3Xd indices = grid.point_to_index() * (mesh.nodes.colwise() - grid.origin);
    detail::rasterise(indices, mesh.tets, grid.size, [&](int tet, const Eigen::Vector4d&) {
        return [&, label = mesh.labels[tet]](const detail::TetRow& row) {
            std::fill(voxels + labels.offset(row.first, row.j, row.k),
                      voxels + labels.offset(row.last, row.j, row.k) + 1, label);
        };
    });
    return labels;
}

}  // namespace tissuewarp::registration
