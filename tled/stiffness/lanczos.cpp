#include "tled/stiffness/lanczos.hpp"

#include <Eigen/Eigenvalues>

#include <cmath>
#include <vector>

namespace tissuewarp::tled::detail {

using Eigen::MatrixXd;
using Eigen::VectorXd;

double lowest_by_lanczos(const std::function<VectorXd(const VectorXd&)>& solve, const VectorXd& D) {
    constexpr int most_steps = 20;
    constexpr double tolerance = 1e-4;  // damping presets and frequencies, its users, follow √λ
    VectorXd q(D.size());
    for (int i = 0; i < q.size(); ++i) q[i] = 1.0 + 0.5 * std::sin(0.7 * i);
    q /= std::sqrt(q.dot(D.cwiseProduct(q)));
    std::vector<VectorXd> basis;
    MatrixXd projected = MatrixXd::Zero(most_steps + 1, most_steps + 1);  // of K⁻¹ D, tridiagonal
    double largest = 0.0;
    for (int step = 0; step < most_steps; ++step) {
        basis.push_back(q);
        VectorXd next = solve(D.cwiseProduct(q));
        projected(step, step) = next.dot(D.cwiseProduct(q));
        for (int pass = 0; pass < 2; ++pass)
            for (const VectorXd& other : basis) next -= next.dot(D.cwiseProduct(other)) * other;
        const double length = std::sqrt(next.dot(D.cwiseProduct(next)));
        const Eigen::SelfAdjointEigenSolver<MatrixXd> ritz(projected.topLeftCorner(step + 1, step + 1));
        const double before = largest;
        largest = ritz.eigenvalues()[step];
        const double remainder = length * std::abs(ritz.eigenvectors()(step, step));
        const bool settled = remainder <= std::sqrt(tolerance) * largest && largest - before <= tolerance * largest;
        if (settled || remainder <= tolerance * largest) break;  // none remains once all directions are spanned
        projected(step + 1, step) = projected(step, step + 1) = length;
        q = next / length;
    }
    return 1.0 / largest;
}

}  // namespace tissuewarp::tled::detail
