#include "registration/detail/pull.hpp"

#include <Eigen/Eigenvalues>

#include <tbb/parallel_for.h>

namespace tissuewarp::registration::detail {

namespace {

/// x of least norm with K x = f, for f in the range of K.
Eigen::Vector3d least_norm_solution(const Eigen::Matrix3d& stiffness, const Eigen::Vector3d& force) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(stiffness);
    const double least = 1e-9 * axes.eigenvalues()[2];
    Eigen::Vector3d along = axes.eigenvectors().transpose() * force;
    for (int axis = 0; axis < 3; ++axis)
        along[axis] = axes.eigenvalues()[axis] > least ? along[axis] / axes.eigenvalues()[axis] : 0.0;
    return axes.eigenvectors() * along;
}

}  // namespace

std::optional<meshing::Location> locate_near(const meshing::PointLocator& locator, const Eigen::Vector3d& point) {
    for (const double tolerance : {1e-9, 0.1, 0.25, 0.5}) {
        if (auto found = locator.find(point, tolerance)) {
            found->barycentric = found->barycentric.cwiseMax(0.0);
            found->barycentric /= found->barycentric.sum();
            return found;
        }
    }
    return std::nullopt;
}

Eigen::Vector3d displacement_at(const meshing::TetMesh& mesh, const Eigen::Matrix3Xd& displacement,
                                const meshing::Location& at) {
    return displacement(Eigen::all, mesh.tets.col(at.tet)) * at.barycentric;
}

std::vector<tled::Spring> lumped_springs(const meshing::TetMesh& mesh, const std::vector<Pull>& pulls,
                                         const Eigen::Matrix3Xd& displacement) {
    struct Sum {
        Eigen::Matrix3d stiffness = Eigen::Matrix3d::Zero();
        Eigen::Vector3d force = Eigen::Vector3d::Zero();
    };
    std::vector<Sum> sums(static_cast<std::size_t>(mesh.node_count()));
    for (const Pull& pull : pulls) {
        const Eigen::Vector3d force = pull.stiffness * (pull.target - displacement_at(mesh, displacement, pull.at));
        for (int corner = 0; corner < 4; ++corner) {
            Sum& sum = sums[static_cast<std::size_t>(mesh.tets(corner, pull.at.tet))];
            sum.stiffness += pull.at.barycentric[corner] * pull.stiffness;
            sum.force += pull.at.barycentric[corner] * force;
        }
    }
    std::vector<tled::Spring> springs;
    for (int node = 0; node < mesh.node_count(); ++node)
        if (sums[static_cast<std::size_t>(node)].stiffness.trace() > 0) springs.emplace_back().node = node;
    tbb::parallel_for(std::size_t{0}, springs.size(), [&](std::size_t n) {
        tled::Spring& spring = springs[n];
        const auto& [stiffness, force] = sums[static_cast<std::size_t>(spring.node)];
        spring.stiffness = stiffness;
        spring.target = displacement.col(spring.node) + least_norm_solution(stiffness, force);
    });
    return springs;
}

}  // namespace tissuewarp::registration::detail
