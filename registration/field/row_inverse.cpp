#include "registration/field/row_inverse.hpp"

#include <Eigen/Dense>

#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>

namespace tissuewarp::registration::detail {

namespace {

struct Inverse {
    Eigen::Vector3d w;
    bool converged;
};

/// w = X − z with X + u(X) = z, u the continued forward field: Broyden steps (his first method, Math. Comp. 19, 1965)
/// from the guess w, shortened until the residual falls, which it does where the field does not fold. The gradient just
/// outside the mesh is close to a rank-one matrix, ∂u/∂n ⊗ n, which one update learns. `negligible` mm are left to a
/// last step that is not checked.
Inverse inverted(const Continuation& forward, const Eigen::Vector3d& z, Eigen::Vector3d w, double negligible) {
    constexpr int most_steps = row_inverse_options.steps, most_halvings = row_inverse_options.halvings;
    Eigen::Matrix3d inverse_gradient = Eigen::Matrix3d::Identity();
    Eigen::Vector3d residual = w + forward(z + w);
    for (int step = 0; step < most_steps && residual.squaredNorm() > negligible * negligible; ++step) {
        Eigen::Vector3d change = -inverse_gradient * residual, next_residual;
        int halvings = 0;
        for (;; ++halvings, change *= 0.5) {
            next_residual = w + change + forward(z + w + change);
            if (next_residual.squaredNorm() < residual.squaredNorm() || halvings == most_halvings) break;
        }
        if (halvings == most_halvings) break;
        const Eigen::Vector3d predicted = inverse_gradient * (next_residual - residual);
        if (const double scale = change.dot(predicted); std::abs(scale) > 1e-12)
            inverse_gradient += (change - predicted) * (change.transpose() * inverse_gradient) / scale;
        w += change;
        residual = next_residual;
    }
    if (!(residual.squaredNorm() <= negligible * negligible)) return {w, false};
    return {w - inverse_gradient * residual, true};  // the next step, not worth its evaluation
}

}  // namespace

Eigen::Vector3d LazyContinuation::operator()(const Eigen::Vector3d& point) {
    // Isolated: a thread that waits for its own loops must not take up a row that waits for it.
    std::call_once(made_, [&] { tbb::this_task_arena::isolate([&] { continuation_.emplace(make_()); }); });
    return (*continuation_)(point);
}

Eigen::Vector3d RowInverse::operator()(int i, const Eigen::Vector3d& z) {
    constexpr double negligible = row_inverse_options.negligible_mm, exact = row_inverse_options.exact_mm;
    known_ = i == last_ + 1 ? std::min(known_ + 1, 2) : 0;
    Inverse found{Eigen::Vector3d::Zero(), false};
    if (known_ == 2) found = inverted(forward_, z, 2.0 * before_ - two_before_, negligible);
    if (!found.converged) found = inverted(forward_, z, Eigen::Vector3d::Zero(), exact);
    if (!found.converged) found = inverted(forward_, z, backward_(z), negligible);
    if (!found.converged) known_ = -1;
    two_before_ = before_;
    before_ = found.w;
    last_ = i;
    return found.w;
}

}  // namespace tissuewarp::registration::detail
