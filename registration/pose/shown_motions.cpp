#include "registration/pose/shown_motions.hpp"

#include "registration/pose/rigid_part.hpp"

#include <Eigen/Eigenvalues>

namespace tissuewarp::registration::detail {

ShownMotions shown_motions(const LastPulls& pulls, const Eigen::Matrix3Xd& nodes) {
    using Matrix6d = Eigen::Matrix<double, 6, 6>;
    const Eigen::MatrixXd motions = rigid_motions(nodes);
    Matrix6d felt = Matrix6d::Zero();
    double trace = 0;
    for (const PulledNode& pulled : pulls.springs) {
        if (pulled.origin != Origin::Datum && pulled.origin != Origin::Support) continue;
        const auto here = motions.middleRows<3>(3 * pulled.spring.node);
        felt += here.transpose() * pulled.spring.stiffness * here;
        trace += pulled.spring.stiffness.trace();
    }
    const Matrix6d squares = motions.transpose() * motions / double(nodes.cols());
    const Eigen::GeneralizedSelfAdjointEigenSolver<Matrix6d> axes(felt / trace, squares);
    return {axes.eigenvalues(), motions * axes.eigenvectors()};
}

std::optional<Doubt> doubt_of_placement(const LastPulls& pulls, const Eigen::Matrix3Xd& nodes) {
    constexpr double limit = shown_motion_limits.least_share;
    if (!pulls.placement_sought) return std::nullopt;
    const double least = shown_motions(pulls, nodes).shares[0];
    if (least >= limit) return std::nullopt;
    return Doubt{"placement.loose", least, limit,
                 "the data hardly tell how the organ is turned, or where it lies along a line: it may move as a whole "
                 "without leaving them",
                 "give landmarks or an image beside them, or leave the organ where the headers place it if they are "
                 "right (--no-align)"};
}

}  // namespace tissuewarp::registration::detail
