/// Local fits in the lanes of vectors against one after the other.
#include "registration/matching/consistency/local_affine.hpp"

#include <Eigen/Cholesky>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

namespace tissuewarp::registration::detail {
namespace {

using Vector12d = Eigen::Matrix<double, 12, 1>;
using Matrix12d = Eigen::Matrix<double, 12, 12>;

/// d(x) = t + G ξ, ξ = (x − point)/radius.
class PlainFit {
public:
    PlainFit(const ScatteredMotion& motion, const Eigen::Vector3d& point, const std::vector<int>& neighbours)
        : motion_(motion), point_(point), neighbours_(neighbours) {
        for (const int n : neighbours) radius_ = std::max(radius_, (motion.points.col(n) - point).norm());
    }

    [[nodiscard]] LocalMotion trimmed(double share) const {
        if (neighbours_.empty()) return {};
        const auto kept = static_cast<std::size_t>(std::ceil((1 - share) * double(neighbours_.size())));
        std::vector<std::size_t> used(neighbours_.size()), ranked;
        std::iota(used.begin(), used.end(), std::size_t{0});
        std::vector<double> residuals;
        Vector12d affine = solved(used);
        for (int step = 0; step < 4; ++step) {
            residuals = squared_residuals(affine);
            ranked.resize(neighbours_.size());
            std::iota(ranked.begin(), ranked.end(), std::size_t{0});
            std::stable_sort(ranked.begin(), ranked.end(),
                             [&](std::size_t a, std::size_t b) { return residuals[a] < residuals[b]; });
            std::vector<std::size_t> lowest(ranked.begin(), ranked.begin() + static_cast<std::ptrdiff_t>(kept));
            std::sort(lowest.begin(), lowest.end());
            if (lowest == used) break;
            used = std::move(lowest);
            affine = solved(used);
        }
        return {affine.head<3>(), std::sqrt(residuals[ranked[ranked.size() / 2]])};
    }

private:
    const ScatteredMotion& motion_;
    const Eigen::Vector3d& point_;
    const std::vector<int>& neighbours_;
    double radius_ = 1e-6;

    [[nodiscard]] Eigen::Matrix<double, 3, 12> design(int n) const {
        const Eigen::Vector3d xi = (motion_.points.col(n) - point_) / radius_;
        Eigen::Matrix<double, 3, 12> result;
        result << Eigen::Matrix3d::Identity(), xi[0] * Eigen::Matrix3d::Identity(), xi[1] * Eigen::Matrix3d::Identity(),
            xi[2] * Eigen::Matrix3d::Identity();
        return result;
    }

    [[nodiscard]] Vector12d solved(const std::vector<std::size_t>& used) const {
        Matrix12d matrix = Matrix12d::Zero();
        Vector12d right = Vector12d::Zero();
        for (const std::size_t place : used) {
            const int n = neighbours_[place];
            const auto A = design(n);
            const Eigen::Matrix3d& W = motion_.weights[static_cast<std::size_t>(n)];
            matrix += A.transpose() * W * A;
            right += A.transpose() * W * motion_.displacements.col(n);
        }
        const double scale = matrix.topLeftCorner<3, 3>().trace() / 3;
        matrix.diagonal().head<3>().array() += 1e-6 * scale + 1e-12;
        matrix.diagonal().tail<9>().array() += 0.02 * scale + 1e-12;
        return matrix.ldlt().solve(right);
    }

    [[nodiscard]] std::vector<double> squared_residuals(const Vector12d& affine) const {
        std::vector<double> result;
        for (const int n : neighbours_) {
            const Eigen::Vector3d e = design(n) * affine - motion_.displacements.col(n);
            result.push_back(e.dot(motion_.weights[static_cast<std::size_t>(n)] * e));
        }
        return result;
    }
};

/// An affine motion, noise, every fifth displacement far off; blocks on planes and edges weigh along some directions.
ScatteredMotion scattered(int count) {
    std::mt19937 random(5);
    std::normal_distribution<double> normal;
    const auto vector = [&] { return Eigen::Vector3d(normal(random), normal(random), normal(random)); };
    ScatteredMotion motion{Eigen::Matrix3Xd(3, count), Eigen::Matrix3Xd(3, count), {}};
    Eigen::Matrix3d G;
    G << vector(), vector(), vector();
    for (int n = 0; n < count; ++n) {
        motion.points.col(n) = 30 * vector();
        motion.displacements.col(n) =
            0.1 * G * motion.points.col(n) + 0.2 * vector() + (n % 5 == 0 ? 8.0 : 0.0) * vector();
        Eigen::Matrix3d W = Eigen::Matrix3d::Zero();
        for (int rank = 0; rank <= n % 3; ++rank) {
            const Eigen::Vector3d along = vector().normalized();
            W += along * along.transpose() / 3;
        }
        motion.weights.push_back(n % 11 == 0 ? Eigen::Matrix3d::Zero() : W);
    }
    return motion;
}

// A lane that sees another's neighbours, an entry of the normal matrix in the wrong place, ranks that ties or lanes
// with fewer neighbours upset: 203 points, so that the last vector is not full, with 0 to 24 neighbours each.
TEST(LocalAffine, LanesAgreeWithFitsOneByOne) {
    constexpr int count = 203;
    const ScatteredMotion motion = scattered(count);
    std::vector<std::vector<int>> neighbours = nearest_neighbours(motion.points, 24);
    for (std::size_t n = 0; n < neighbours.size(); n += 7) neighbours[n].resize(n % 25);
    for (const double share : {0.0, 0.4, 0.9}) {
        const std::vector<LocalMotion> found = fit_local_affine(motion, motion.points, neighbours, share);
        ASSERT_EQ(found.size(), neighbours.size());
        for (std::size_t n = 0; n < neighbours.size(); ++n) {
            const Eigen::Vector3d point = motion.points.col(static_cast<Eigen::Index>(n));
            const LocalMotion plain = PlainFit(motion, point, neighbours[n]).trimmed(share);
            EXPECT_LT((found[n].displacement - plain.displacement).norm(), 1e-6) << n << ", " << share;
            EXPECT_NEAR(found[n].residual_mm, plain.residual_mm, 1e-6) << n << ", " << share;
        }
    }
}

}  // namespace
}  // namespace tissuewarp::registration::detail
