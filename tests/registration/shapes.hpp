#pragma once
/// Meshes, grids and deformations that the tests of this folder share.

#include "imaging/volume.hpp"
#include "meshing/primitives.hpp"
#include "registration/deformation.hpp"

#include <Eigen/Geometry>

#include <functional>

namespace tissuewarp::registration::test {

/// A box mesh with a corner at `corner`.
inline meshing::TetMesh box_at(const Eigen::Vector3d& corner, const Eigen::Vector3d& size,
                               const std::array<int, 3>& cells, double jitter = 0.0) {
    meshing::TetMesh mesh = meshing::box_mesh(size, cells, jitter);
    mesh.nodes.colwise() += corner;
    return mesh;
}

/// A ball: the box mesh [−1, 1]³ with its cubes drawn out to spheres.
inline meshing::TetMesh ball(const Eigen::Vector3d& centre, double radius, int cells) {
    meshing::TetMesh mesh = meshing::box_mesh({2, 2, 2}, {cells, cells, cells});
    for (auto node : mesh.nodes.colwise()) {
        const Eigen::Vector3d p = node.array() - 1.0;
        const double length = p.norm();
        node = length > 0.0 ? Eigen::Vector3d(centre + radius * p.cwiseAbs().maxCoeff() / length * p) : centre;
    }
    return mesh;
}

/// Both in one mesh, of one label.
inline meshing::TetMesh beside(const meshing::TetMesh& a, const meshing::TetMesh& b) {
    meshing::TetMesh both = a;
    both.nodes.conservativeResize(3, a.node_count() + b.node_count());
    both.nodes.rightCols(b.node_count()) = b.nodes;
    both.tets.conservativeResize(4, a.tet_count() + b.tet_count());
    both.tets.rightCols(b.tet_count()) = b.tets.array() + a.node_count();
    both.labels = Eigen::VectorXi::Ones(both.tet_count());
    return both;
}

/// The deformation whose displacement at the nodes is u(X).
inline Deformation deformed_by(const meshing::TetMesh& mesh,
                               const std::function<Eigen::Vector3d(const Eigen::Vector3d&)>& u) {
    Deformation deformation{mesh, Eigen::Matrix3Xd(3, mesh.node_count()), Eigen::Isometry3d::Identity()};
    for (int n = 0; n < mesh.node_count(); ++n) deformation.displacement.col(n) = u(mesh.nodes.col(n));
    return deformation;
}

inline Eigen::Isometry3d motion(double degrees, const Eigen::Vector3d& axis, const Eigen::Vector3d& shift) {
    Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
    result.linear() = Eigen::AngleAxisd(degrees * EIGEN_PI / 180.0, axis.normalized()).toRotationMatrix();
    result.translation() = shift;
    return result;
}

/// An oblique, left-handed grid of anisotropic voxels around `centre`, with odd sizes.
inline imaging::Geometry oblique_grid(const Eigen::Vector3d& centre, const std::array<int, 3>& size,
                                      const Eigen::Vector3d& spacing) {
    imaging::Geometry grid;
    grid.size = size;
    grid.spacing = spacing;
    grid.direction = motion(25.0, {1.0, 2.0, -0.5}, {0, 0, 0}).linear();
    grid.direction.col(0) *= -1.0;
    grid.origin += centre - grid.point(Eigen::Vector3d(size[0] - 1, size[1] - 1, size[2] - 1) / 2.0);
    return grid;
}

inline imaging::Geometry plain_grid(const std::array<int, 3>& size, double spacing = 1.0,
                                    const Eigen::Vector3d& origin = Eigen::Vector3d::Zero()) {
    imaging::Geometry grid;
    grid.size = size;
    grid.spacing.setConstant(spacing);
    grid.origin = origin;
    return grid;
}

/// Calls visit(index, offset) for every voxel.
template <class Visit>
void for_each_voxel(const imaging::Volume& volume, const Visit& visit) {
    for (int k = 0; k < volume.geometry.size[2]; ++k)
        for (int j = 0; j < volume.geometry.size[1]; ++j)
            for (int i = 0; i < volume.geometry.size[0]; ++i) visit(Eigen::Vector3d(i, j, k), volume.offset(i, j, k));
}

inline Eigen::Vector3d vector_at(const imaging::Volume& field, std::int64_t offset) {
    const cv::Vec3f& v = field.data<cv::Vec3f>()[offset];
    return {v[0], v[1], v[2]};
}

}  // namespace tissuewarp::registration::test
