#include "tled/statics/heavy_ball.hpp"

#include "tled/model/symmetric.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <limits>

namespace tissuewarp::tled::detail {

using Eigen::Matrix3Xd;

namespace {

constexpr int lanczos_steps = 10;     // within 1 % of λ_max; power iteration takes 20 for 3 %
constexpr double step_safety = 1.05;  // on λ_max: Lanczos approaches from below, stiffness grows under load
constexpr double least_ratio = 1e-6;  // of λ_min to λ_max: a way that nothing holds is not waited for
constexpr int most_restarts = 6;
constexpr double damping_factor = 1.4;  // on the lowest eigenvalue of K₀: the slowest mode carries little of the error

/// Smallest λ of shifts of the whole, which springs alone hold: no smaller than λ_min of M⁻¹K. Infinite where
/// displacements are imposed.
double lowest_of_shifts(const NodalConditions& conditions, const Matrix3Xd& mass) {
    if (conditions.constrained.any()) return std::numeric_limits<double>::infinity();
    const Eigen::Matrix3d springs = symmetric_matrix(conditions.spring_stiffness.rowwise().sum());
    const Eigen::Vector3d root = mass.rowwise().sum().cwiseSqrt().cwiseInverse();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> shifts(root.asDiagonal() * springs * root.asDiagonal(),
                                                                Eigen::EigenvaluesOnly);
    return shifts.eigenvalues().minCoeff();
}

Spectrum bounded(double highest, const EquilibriumSearch& search, const Matrix3Xd& mass, double lowest_at_rest) {
    const double lowest = damping_factor * std::min(lowest_at_rest, lowest_of_shifts(search.conditions, mass));
    return {std::clamp(lowest, least_ratio * highest, highest / 4), highest};
}

}  // namespace

StepCoefficients heavy_ball(const Spectrum& spectrum) {
    const double high = std::sqrt(spectrum.highest), low = std::sqrt(spectrum.lowest);
    const double ratio = (high - low) / (high + low);
    return {ratio * ratio, 4 / ((high + low) * (high + low))};
}

double decay(const Spectrum& spectrum) {
    return -0.5 * std::log(heavy_ball(spectrum).momentum);
}

Spectrum spectrum_at(EquilibriumSearch& search, const Matrix3Xd& mass, const Matrix3Xd& residual,
                     double lowest_at_rest) {
    const Matrix3Xd u = search.last_good(), still = Matrix3Xd::Zero(3, u.cols());
    // Large enough to stand clear of round-off in u, small enough to stay near the tangent.
    const double amplitude = std::max(std::cbrt(search.engine.precision()), 1e-3) * 0.3;
    const Matrix3Xd root = mass.cwiseSqrt();
    Matrix3Xd q = search.conditions.constrained.select(still, fixed_vector(u.cols())), previous = still;
    q /= q.norm();
    Eigen::MatrixXd T = Eigen::MatrixXd::Zero(lanczos_steps, lanczos_steps);
    double beta = 0;
    int size = 0;
    while (size < lanczos_steps) {
        const Matrix3Xd direction = q.cwiseQuotient(root);
        const double h = amplitude / largest_norm(direction);
        search.engine.set_state(u + h * direction, still);
        Matrix3Xd w = ((residual - search.residual()) / h).cwiseQuotient(root) - beta * previous;
        T(size, size) = w.cwiseProduct(q).sum();
        w -= T(size, size) * q;
        beta = w.norm();
        if (++size == lanczos_steps || !(beta > 1e-6 * T(0, 0))) break;
        T(size, size - 1) = T(size - 1, size) = beta;
        previous = q;
        q = w / beta;
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(T.topLeftCorner(size, size), Eigen::EigenvaluesOnly);
    const double highest = step_safety * eigen.eigenvalues().maxCoeff();
    if (!(highest > 0)) search.fail_stalled();
    search.engine.set_state(u, still);
    return bounded(highest, search, mass, lowest_at_rest);
}

Spectrum spectrum_of(double highest, const EquilibriumSearch& search, const Matrix3Xd& mass, double lowest_at_rest) {
    constexpr double reserve = 1.05;
    return bounded(reserve * highest, search, mass, lowest_at_rest);
}

void go_back(EquilibriumSearch& search, int restarts) {
    if (restarts > most_restarts || !search.admissible(search.last_good())) search.fail_stalled();
    search.observer.note("relaxation restarted from the last good state with a smaller step");
}

Spectrum shortened(Spectrum spectrum, int restarts) {
    spectrum.highest *= 1 << restarts;
    return spectrum;
}

}  // namespace tissuewarp::tled::detail
