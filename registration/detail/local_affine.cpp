#include "registration/detail/local_affine.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>

namespace tissuewarp::registration::detail {

namespace {

using Vector12d = Eigen::Matrix<double, 12, 1>;
using Matrix12d = Eigen::Matrix<double, 12, 12>;

/// d(x) = t + G ξ with ξ = (x − centre)/radius; unknowns column by column: t, then the columns of G.
class AffineFit {
public:
    AffineFit(const ScatteredMotion& motion, const Eigen::Vector3d& centre, const std::vector<int>& neighbours)
        : motion_(motion), centre_(centre) {
        for (const int n : neighbours) radius_ = std::max(radius_, (motion.points.col(n) - centre).norm());
    }

    [[nodiscard]] Vector12d solve(const std::vector<int>& used) const {
        Matrix12d matrix = Matrix12d::Zero();  // its lower triangle, which the factorisation reads
        Vector12d right = Vector12d::Zero();
        for (const int n : used) {
            const Eigen::Vector4d phi = basis(n);
            const Eigen::Matrix3d& weight = motion_.weights[static_cast<std::size_t>(n)];
            const Eigen::Vector3d pull = weight * motion_.displacements.col(n);
            for (int a = 0; a < 4; ++a) {
                right.segment<3>(3 * a) += phi[a] * pull;
                for (int b = 0; b <= a; ++b) matrix.block<3, 3>(3 * a, 3 * b) += phi[a] * phi[b] * weight;
            }
        }
        // A little stiffness against stretch keeps few or collinear neighbours from extrapolating.
        const double scale = matrix.topLeftCorner<3, 3>().trace() / 3;
        matrix.diagonal().head<3>().array() += 1e-6 * scale + 1e-12;
        matrix.diagonal().tail<9>().array() += 0.02 * scale + 1e-12;
        return matrix.llt().solve(right);
    }

    [[nodiscard]] double squared_residual(const Vector12d& affine, int n) const {
        const Eigen::Vector4d phi = basis(n);
        Eigen::Vector3d e = -motion_.displacements.col(n);
        for (int a = 0; a < 4; ++a) e += phi[a] * affine.segment<3>(3 * a);
        return e.dot(motion_.weights[static_cast<std::size_t>(n)] * e);
    }

private:
    const ScatteredMotion& motion_;
    Eigen::Vector3d centre_;
    double radius_ = 1e-6;

    [[nodiscard]] Eigen::Vector4d basis(int n) const {
        Eigen::Vector4d phi;
        phi << 1, (motion_.points.col(n) - centre_) / radius_;
        return phi;
    }
};

}  // namespace

LocalMotion fit_local_affine(const ScatteredMotion& motion, const Eigen::Vector3d& point,
                             const std::vector<int>& neighbours, double trimmed_share) {
    constexpr int concentration_steps = 4;
    const AffineFit fit(motion, point, neighbours);
    const auto kept = static_cast<std::ptrdiff_t>(std::ceil((1 - trimmed_share) * double(neighbours.size())));
    std::vector<int> used = neighbours, before;
    std::vector<std::pair<double, int>> residuals;
    residuals.reserve(neighbours.size());
    Vector12d affine = fit.solve(used);
    for (int step = 0; step < concentration_steps && kept > 0; ++step) {
        residuals.clear();
        for (const int n : neighbours) residuals.emplace_back(fit.squared_residual(affine, n), n);
        std::nth_element(residuals.begin(), residuals.begin() + (kept - 1), residuals.end());
        before.swap(used);
        used.clear();
        for (std::ptrdiff_t n = 0; n < kept; ++n) used.push_back(residuals[static_cast<std::size_t>(n)].second);
        std::sort(used.begin(), used.end());
        if (used == before) break;
        affine = fit.solve(used);
    }
    const auto middle = static_cast<std::ptrdiff_t>(residuals.size() / 2);
    std::nth_element(residuals.begin(), residuals.begin() + middle, residuals.end());
    return {affine.head<3>(), residuals.empty() ? 0.0 : std::sqrt(residuals[static_cast<std::size_t>(middle)].first)};
}

Eigen::Matrix3d neighbour_weight(const BlockMatch& match) {
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes;
    const double largest = axes.computeDirect(match.information, Eigen::EigenvaluesOnly).eigenvalues()[2];
    if (!(largest > 0)) return Eigen::Matrix3d::Zero();
    return match.confidence / largest * match.information;
}

}  // namespace tissuewarp::registration::detail
