#include "registration/evaluation/model_labels.hpp"

#include "registration/field/rasterisation.hpp"

#include <algorithm>
#include <cmath>

namespace tissuewarp::registration::detail {

namespace {

using imaging::Geometry;
using imaging::Volume;

Eigen::Matrix3Xd indices_of(const Geometry& grid, const Eigen::Matrix3Xd& points) {
    return grid.point_to_index() * (points.colwise() - grid.origin);
}

/// The label of the voxel nearest to a continuous index, 0 beyond the grid.
int label_at(const Volume& labels, const Eigen::Vector3d& index) {
    std::array<int, 3> voxel;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        voxel[axis] = static_cast<int>(std::floor(index[static_cast<Eigen::Index>(axis)] + 0.5));
        if (voxel[axis] < 0 || voxel[axis] >= labels.geometry.size[axis]) return 0;
    }
    return labels.data<std::int32_t>()[labels.offset(voxel[0], voxel[1], voxel[2])];
}

}  // namespace

Volume labels_of_model(const Deformation& deformation, const Volume& moving_labels, const Geometry& grid) {
    Volume shown(grid, CV_32SC1);
    const Volume labels = moving_labels.as(CV_32S);
    const Eigen::Matrix3Xd rest = indices_of(labels.geometry, deformation.mesh.nodes);
    const Eigen::Matrix4Xi& tets = deformation.mesh.tets;
    auto* voxels = shown.data<std::int32_t>();
    rasterise(indices_of(grid, deformation.deformed_nodes()), tets, grid.size,
              [&](int tet, const Eigen::Vector4d& step) {
                  const Eigen::Matrix<double, 3, 4> corners = rest(Eigen::all, tets.col(tet));
                  const Eigen::Vector3d stride = corners * step;
                  return [&, corners, stride](const TetRow& row) {
                      Eigen::Vector3d at = corners * row.at_first;
                      for (int i = row.first; i <= row.last; ++i, at += stride)
                          voxels[shown.offset(i, row.j, row.k)] = label_at(labels, at);
                  };
              });
    return shown;
}

}  // namespace tissuewarp::registration::detail
