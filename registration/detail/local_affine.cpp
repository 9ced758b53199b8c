#include "registration/detail/local_affine.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace tissuewarp::registration::detail {

namespace {

using Vector12d = Eigen::Matrix<double, 12, 1>;
using Matrix12d = Eigen::Matrix<double, 12, 12>;

/// d(x) = t + G ξ with ξ = (x − centre)/radius; unknowns column by column: t, then the columns of G.
class AffineFit {
public:
    AffineFit(const ScatteredMotion& motion, const Eigen::Vector3d& centre, const std::vector<int>& neighbours) {
        double radius = 1e-6;
        for (const int n : neighbours) radius = std::max(radius, (motion.points.col(n) - centre).norm());
        data_.resize(neighbours.size());
        for (std::size_t k = 0; k < neighbours.size(); ++k) {
            const int n = neighbours[k];
            const Eigen::Matrix3d& W = motion.weights[static_cast<std::size_t>(n)];
            Datum& datum = data_[k];
            datum.phi << 1, (motion.points.col(n) - centre) / radius;
            datum.weight << W(0, 0), W(1, 0), W(2, 0), W(1, 1), W(2, 1), W(2, 2);
            datum.displacement = motion.displacements.col(n);
            datum.pull = W * datum.displacement;
        }
    }

    /// `used` are places among the neighbours.
    [[nodiscard]] Vector12d solve(const std::vector<int>& used) const {
        Eigen::Array<double, 6, 10> sums = Eigen::Array<double, 6, 10>::Zero();  // Σ φ_a φ_b W, b ≤ a
        Eigen::Matrix<double, 3, 4> right = Eigen::Matrix<double, 3, 4>::Zero();
        for (const int n : used) {
            const Datum& datum = data_[static_cast<std::size_t>(n)];
            for (int a = 0, pair = 0; a < 4; ++a) {
                right.col(a) += datum.phi[a] * datum.pull;
                for (int b = 0; b <= a; ++b) sums.col(pair++) += datum.phi[a] * datum.phi[b] * datum.weight;
            }
        }
        Matrix12d matrix;  // its lower triangle, which the factorisation reads
        for (int a = 0, pair = 0; a < 4; ++a)
            for (int b = 0; b <= a; ++b) {
                const auto w = sums.col(pair++);
                matrix.block<3, 3>(3 * a, 3 * b) << w[0], w[1], w[2], w[1], w[3], w[4], w[2], w[4], w[5];
            }
        // A little stiffness against stretch keeps few or collinear neighbours from extrapolating.
        const double scale = matrix.topLeftCorner<3, 3>().trace() / 3;
        matrix.diagonal().head<3>().array() += 1e-6 * scale + 1e-12;
        matrix.diagonal().tail<9>().array() += 0.02 * scale + 1e-12;
        return matrix.llt().solve(right.reshaped());
    }

    [[nodiscard]] double squared_residual(const Vector12d& affine, int n) const {
        const Datum& datum = data_[static_cast<std::size_t>(n)];
        const Eigen::Vector3d e = affine.reshaped(3, 4) * datum.phi - datum.displacement;
        const auto& w = datum.weight;
        return w[0] * e[0] * e[0] + w[3] * e[1] * e[1] + w[5] * e[2] * e[2] +
               2 * (w[1] * e[0] * e[1] + w[2] * e[0] * e[2] + w[4] * e[1] * e[2]);
    }

private:
    struct Datum {
        Eigen::Vector4d phi;                // 1, ξ
        Eigen::Array<double, 6, 1> weight;  // W: 00 10 20 11 21 22
        Eigen::Vector3d displacement, pull;
    };
    std::vector<Datum> data_;
};

}  // namespace

LocalMotion fit_local_affine(const ScatteredMotion& motion, const Eigen::Vector3d& point,
                             const std::vector<int>& neighbours, double trimmed_share) {
    constexpr int concentration_steps = 4;
    const AffineFit fit(motion, point, neighbours);
    const auto kept = static_cast<std::ptrdiff_t>(std::ceil((1 - trimmed_share) * double(neighbours.size())));
    std::vector<int> used(neighbours.size()), before;
    std::iota(used.begin(), used.end(), 0);
    std::vector<std::pair<double, int>> residuals;
    residuals.reserve(neighbours.size());
    Vector12d affine = fit.solve(used);
    for (int step = 0; step < concentration_steps && kept > 0; ++step) {
        residuals.clear();
        for (int n = 0; n < static_cast<int>(neighbours.size()); ++n)
            residuals.emplace_back(fit.squared_residual(affine, n), n);
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
