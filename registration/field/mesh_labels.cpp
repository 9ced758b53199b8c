#include "registration/field/mesh_labels.hpp"

#include "registration/field/rasterisation.hpp"

namespace tissuewarp::registration {

namespace {

/// fill(tet) gives the value of the voxels in a tetrahedron.
template <class Value, class Fill>
void fill_voxels(imaging::Volume& volume, const meshing::TetMesh& mesh, const Fill& fill) {
    const imaging::Geometry& grid = volume.geometry;
    auto* voxels = volume.data<Value>();
    const Eigen::Matrix3Xd indices = grid.point_to_index() * (mesh.nodes.colwise() - grid.origin);
    detail::rasterise(indices, mesh.tets, grid.size, [&](int tet, const Eigen::Vector4d&) {
        return [&, value = fill(tet)](const detail::TetRow& row) {
            std::fill(voxels + volume.offset(row.first, row.j, row.k),
                      voxels + volume.offset(row.last, row.j, row.k) + 1, value);
        };
    });
}

}  // namespace

imaging::Volume labels_of_mesh(const meshing::TetMesh& mesh, const imaging::Geometry& grid) {
    imaging::Volume labels(grid, CV_32SC1);
    fill_voxels<std::int32_t>(labels, mesh, [&](int tet) { return mesh.labels[tet]; });
    return labels;
}

imaging::Volume mask_of_mesh(const meshing::TetMesh& mesh, const imaging::Geometry& grid) {
    imaging::Volume mask(grid, CV_8UC1);
    fill_voxels<std::uint8_t>(mask, mesh, [](int) { return std::uint8_t{1}; });
    return mask;
}

}  // namespace tissuewarp::registration
