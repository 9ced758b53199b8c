#include "registration/uncertainty/slip_motions.hpp"

#include "registration/pose/rigid_part.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <vector>

namespace tissuewarp::registration::detail {

namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;

std::vector<bool> nodes_of(const meshing::TetMesh& mesh, int label) {
    std::vector<bool> nodes(static_cast<std::size_t>(mesh.nodes.cols()), false);
    for (Eigen::Index t = 0; t < mesh.tets.cols(); ++t)
        if (mesh.labels[t] == label)
            for (const int node : mesh.tets.col(t)) nodes[static_cast<std::size_t>(node)] = true;
    return nodes;
}

/// Of six motions (3N × 6) those sums that lead surfaces along themselves, each of mean square 1 mm² at the pairs.
MatrixXd along_surface(const std::vector<tled::SlidingPair>& pairs, const MatrixXd& motions) {
    Eigen::Matrix<double, 6, 6> across = Eigen::Matrix<double, 6, 6>::Zero(), all = across;
    double weights = 0;
    for (const tled::SlidingPair& pair : pairs) {
        const auto here = motions.middleRows<3>(3 * pair.first);
        const Eigen::Matrix<double, 1, 6> out = pair.normal.transpose() * here;
        across += pair.stiffness * out.transpose() * out;
        all += pair.stiffness * here.transpose() * here;
        weights += pair.stiffness;
    }
    constexpr double regular = 1e-9;  // where nodes lie on a line
    all.diagonal().array() += regular * all.trace();
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> axes(across, all);
    const auto slide = (axes.eigenvalues().array() < slip_model.most_across).count();
    return std::sqrt(weights) * motions * axes.eigenvectors().leftCols(slide);
}

}  // namespace

double slid_mm(const std::vector<tled::SlidingPair>& pairs, const Eigen::Matrix3Xd& displacement) {
    double squared = 0, weights = 0;
    for (const tled::SlidingPair& pair : pairs) {
        const Vector3d apart = displacement.col(pair.first) - displacement.col(pair.second),
                       along = apart - pair.normal.dot(apart) * pair.normal;
        squared += pair.stiffness * along.squaredNorm();
        weights += pair.stiffness;
    }
    return weights > 0 ? std::sqrt(squared / weights) : 0;
}

MatrixXd slip_motions(const PreparedModel& prepared, const Eigen::Matrix3Xd& displacement) {
    const meshing::TetMesh& mesh = prepared.model.mesh;
    MatrixXd result(mesh.nodes.size(), 0);
    for (const std::array<int, 2>& labels : prepared.options.sliding) {
        const std::vector<bool> first = nodes_of(mesh, labels[0]), second = nodes_of(mesh, labels[1]);
        std::vector<tled::SlidingPair> pairs = prepared.sliding;
        std::erase_if(pairs, [&](const tled::SlidingPair& pair) {
            return !first[static_cast<std::size_t>(pair.first)] || !second[static_cast<std::size_t>(pair.second)];
        });
        MatrixXd slips = along_surface(pairs, rigid_motions(mesh.nodes));
        for (Eigen::Index node = 0; node < mesh.nodes.cols(); ++node)
            if (!first[static_cast<std::size_t>(node)]) slips.middleRows<3>(3 * node).setZero();
        slips *= slip_model.of_slip * slid_mm(pairs, displacement);
        const Eigen::Index before = result.cols();
        result.conservativeResize(Eigen::NoChange, before + slips.cols());
        result.rightCols(slips.cols()) = slips;
    }
    return result;
}

}  // namespace tissuewarp::registration::detail
