#include "registration/springs/pull.hpp"

#include <Eigen/Eigenvalues>

#include <tbb/parallel_for.h>

namespace tissuewarp::registration::detail {

namespace {

/// x of least norm with K x = f, for f in the range of K.
Eigen::Vector3d least_norm_solution(const Eigen::Matrix3d& stiffness, const Eigen::Vector3d& force) {
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes;
    axes.computeDirect(stiffness);
    const double least = 1e-9 * axes.eigenvalues()[2];
    Eigen::Vector3d along = axes.eigenvectors().transpose() * force;
    for (int axis = 0; axis < 3; ++axis)
        along[axis] = axes.eigenvalues()[axis] > least ? along[axis] / axes.eigenvalues()[axis] : 0.0;
    return axes.eigenvectors() * along;
}

}  // namespace

std::optional<meshing::Location> locate_near(const meshing::PointLocator& locator, const Eigen::Vector3d& point) {
    for (const double tolerance : place_options.outside) {
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

NodalShares::NodalShares(const meshing::TetMesh& mesh, std::span<const meshing::Location> places) {
    std::vector<std::size_t> count(static_cast<std::size_t>(mesh.node_count())), next(count.size());
    const auto node_of = [&](const meshing::Location& at, int corner) {
        return static_cast<std::size_t>(mesh.tets(corner, at.tet));
    };
    for (const meshing::Location& at : places)
        for (int corner = 0; corner < 4; ++corner) ++count[node_of(at, corner)];
    first_.push_back(0);
    for (std::size_t node = 0; node < count.size(); ++node) {
        if (count[node] == 0) continue;
        next[node] = first_.back();
        nodes_.push_back(static_cast<int>(node));
        first_.push_back(first_.back() + count[node]);
    }
    shares_.resize(first_.back());
    for (std::size_t n = 0; n < places.size(); ++n)
        for (int corner = 0; corner < 4; ++corner)
            shares_[next[node_of(places[n], corner)]++] = {static_cast<int>(n), places[n].barycentric[corner]};
}

std::vector<tled::Spring> lumped_springs(const NodalShares& shares, std::span<const PullForce> pulls,
                                         const Eigen::Matrix3Xd& displacement) {
    std::vector<tled::Spring> springs(shares.nodes().size());
    tbb::parallel_for(std::size_t{0}, springs.size(), [&](std::size_t n) {
        tled::Spring& spring = springs[n];
        spring.node = shares.nodes()[n];
        spring.stiffness.setZero();
        Eigen::Vector3d force = Eigen::Vector3d::Zero();
        for (const NodalShares::Share& share : shares.of(n)) {
            const PullForce& pull = pulls[static_cast<std::size_t>(share.place)];
            spring.stiffness += share.weight * pull.stiffness;
            force += share.weight * pull.force;
        }
        spring.target = displacement.col(spring.node) + least_norm_solution(spring.stiffness, force);
    });
    std::erase_if(springs, [](const tled::Spring& spring) { return !(spring.stiffness.trace() > 0); });
    return springs;
}

std::vector<tled::Spring> lumped_springs(const meshing::TetMesh& mesh, const std::vector<Pull>& pulls,
                                         const Eigen::Matrix3Xd& displacement) {
    std::vector<meshing::Location> places;
    std::vector<PullForce> forces;
    for (const Pull& pull : pulls) {
        places.push_back(pull.at);
        forces.push_back(
            {pull.stiffness, pull.stiffness * (pull.target - displacement_at(mesh, displacement, pull.at))});
    }
    return lumped_springs(NodalShares(mesh, places), forces, displacement);
}

}  // namespace tissuewarp::registration::detail
