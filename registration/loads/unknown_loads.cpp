#include "registration/loads/unknown_loads.hpp"

#include "registration/loads/smooth_field.hpp"
#include "registration/loads/white_noise.hpp"
#include "registration/pose/rigid_part.hpp"

#include <Eigen/Cholesky>

#include <tbb/parallel_for.h>

#include <cmath>
#include <vector>

namespace tissuewarp::registration::detail {

namespace {

using Columns = Eigen::MatrixXd;  // 3N × k, nodes' vectors one after the other

/// mm³ of each node's share of its elements.
Eigen::VectorXd nodal_volumes(const meshing::TetMesh& mesh) {
    const Eigen::VectorXd volumes = meshing::tet_volumes(mesh);
    Eigen::VectorXd result = Eigen::VectorXd::Zero(mesh.nodes.cols());
    for (Eigen::Index tet = 0; tet < volumes.size(); ++tet)
        for (const int node : mesh.tets.col(tet)) result[node] += volumes[tet] / 4;
    return result;
}

/// mm² of the outer surface.
Eigen::VectorXd nodal_areas(const PreparedModel& prepared) {
    Eigen::VectorXd result = Eigen::VectorXd::Zero(prepared.model.mesh.nodes.cols());
    for (const InterfaceNode& node : prepared.interfaces.nodes())
        if (node.outer == 0) result[node.node] += node.area;
    return result;
}

/// Every node's vectors times its weight.
Columns weighted(const Columns& vectors, const Eigen::VectorXd& weights) {
    Columns result = vectors;
    for (Eigen::Index n = 0; n < weights.size(); ++n) result.middleRows<3>(3 * n) *= weights[n];
    return result;
}

/// Loads and what holds the organ against them as a whole, all over its surface.
Columns in_equilibrium(const Columns& loads, const Eigen::Matrix3Xd& nodes, const Eigen::VectorXd& areas) {
    const Columns motions = rigid_motions(nodes), held = weighted(motions, areas);
    return loads - held * (motions.transpose() * held).ldlt().solve(motions.transpose() * loads);
}

}  // namespace

double radius_of(const Eigen::Matrix3Xd& nodes) {
    const Eigen::Vector3d middle = nodes.rowwise().mean();
    return std::sqrt((nodes.colwise() - middle).colwise().squaredNorm().mean());
}

Columns unknown_loads(const PreparedModel& prepared, int count, std::uint64_t seed) {
    const Eigen::Matrix3Xd& nodes = prepared.model.mesh.nodes;
    const Eigen::VectorXd volumes = nodal_volumes(prepared.model.mesh), areas = nodal_areas(prepared);
    const double radius = radius_of(nodes);
    std::mt19937_64 generator(seed);
    std::vector<Eigen::Vector3d> bodies;
    std::vector<SmoothField> tractions;
    for (int k = 0; k < count; ++k) {
        bodies.emplace_back(white_noise(3, 1, generator) / radius);
        tractions.emplace_back(load_draws.smooth_over * radius, generator);
    }
    Columns loads(nodes.size(), count);
    tbb::parallel_for(0, count, [&](int k) {
        const auto draw = static_cast<std::size_t>(k);
        for (Eigen::Index n = 0; n < nodes.cols(); ++n) {
            loads.block<3, 1>(3 * n, k) = volumes[n] * bodies[draw];
            if (areas[n] > 0) loads.block<3, 1>(3 * n, k) += areas[n] * tractions[draw](nodes.col(n));
        }
    });
    return in_equilibrium(loads, nodes, areas);
}

Columns unknown_body_forces(const PreparedModel& prepared, int count, std::uint64_t seed) {
    const Eigen::Matrix3Xd& nodes = prepared.model.mesh.nodes;
    const Eigen::VectorXd volumes = nodal_volumes(prepared.model.mesh);
    const double radius = radius_of(nodes);
    std::mt19937_64 generator(seed);
    std::vector<SmoothField> bodies;
    for (int k = 0; k < count; ++k) bodies.emplace_back(load_draws.smooth_over * radius, generator);
    Columns loads(nodes.size(), count);
    tbb::parallel_for(0, count, [&](int k) {
        for (Eigen::Index n = 0; n < nodes.cols(); ++n)
            loads.block<3, 1>(3 * n, k) = volumes[n] / radius * bodies[static_cast<std::size_t>(k)](nodes.col(n));
    });
    return in_equilibrium(loads, nodes, volumes);
}

Columns unknown_weights(const PreparedModel& prepared) {
    const Eigen::Matrix3Xd& nodes = prepared.model.mesh.nodes;
    const Eigen::VectorXd densities = nodal_volumes(prepared.model.mesh) / radius_of(nodes);
    Columns weights(nodes.size(), 3);
    for (Eigen::Index n = 0; n < nodes.cols(); ++n)
        weights.middleRows<3>(3 * n) = densities[n] * Eigen::Matrix3d::Identity();
    return in_equilibrium(weights, nodes, nodal_areas(prepared));
}

}  // namespace tissuewarp::registration::detail
