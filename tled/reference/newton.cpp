#include "tled/reference/newton.hpp"
#include "core/errors.hpp"
#include "tled/model/held_tissue.hpp"
#include "tled/model/internal_force.hpp"
#include "tled/model/springs.hpp"
#include "tled/reference/discrete_energy.hpp"
#include "tled/stiffness/cholmod_factor.hpp"
#include "tled/stiffness/stiffness.hpp"

#include <cmath>
#include <memory>
#include <string>

namespace tissuewarp::tled {

using Eigen::Matrix3Xd;
using Eigen::VectorXd;

namespace {

constexpr int max_backtracks = 40;

// K x from the lower triangle.
Matrix3Xd multiply(const detail::BlockRows& lower, const Matrix3Xd& x) {
    Matrix3Xd y = Matrix3Xd::Zero(3, lower.rows());
    for (int i = 0; i < lower.rows(); ++i) {
        for (int k = lower.offset[i]; k < lower.offset[i + 1]; ++k) {
            const int j = lower.column[k];
            y.col(i) += lower.block[k] * x.col(j);
            if (j != i) y.col(j) += lower.block[k].transpose() * x.col(i);
        }
    }
    return y;
}

/// Minimises E(u) + ½ u·K_s u − t u·(K_s target + f_ext) over the free degrees of freedom with u = t · imposed on the
/// others, where the load factor t goes from 0 to 1. From a given start, u goes to the imposed values from those of the
/// start, and the forces act in full. Nocedal & Wright, Numerical Optimization (2006), algorithms 3.1
/// to 3.3.
class Newton {
public:
    Newton(const DiscreteEnergy& energy, const NodalConditions& conditions, const NewtonOptions& options,
           Observer& observer);
    NewtonResult run();

private:
    [[nodiscard]] double potential(const Matrix3Xd& u) const;
    [[nodiscard]] Matrix3Xd residual(const Matrix3Xd& u) const;
    [[nodiscard]] VectorXd reduced(const Matrix3Xd& x) const;
    [[nodiscard]] Matrix3Xd expanded(const VectorXd& x) const;
    [[nodiscard]] detail::BlockRows factorise(const Matrix3Xd& u);
    void raise_load(double increment);
    void equilibrate(double tolerance_mm);
    [[nodiscard]] double line_search(const Matrix3Xd& direction, double slope);
    [[noreturn]] void fail(const std::string& cause) const;

    const DiscreteEnergy& energy_;
    const NodalConditions& conditions_;
    const NewtonOptions& options_;
    Observer& observer_;
    Matrix3Xd applied_;         // K_s target + f_ext, mN
    Matrix3Xd start_, change_;  // mm; of the prescribed components, change_ is imposed − start
    std::vector<int> index_;    // 3·node + component → free number or −1
    std::vector<int> node_of_;  // node of each free degree of freedom
    std::unique_ptr<detail::CholmodFactor> factor_;
    Matrix3Xd u_;             // mm
    double load_factor_ = 0;  // t
    [[nodiscard]] double force_factor() const { return options_.start.size() > 0 ? 1.0 : load_factor_; }
    double last_raise_mm_ = 0;
    NewtonResult result_;
};

Newton::Newton(const DiscreteEnergy& energy, const NodalConditions& conditions, const NewtonOptions& options,
               Observer& observer)
    : energy_(energy),
      conditions_(conditions),
      options_(options),
      observer_(observer),
      applied_(detail::applied_force(conditions)),
      start_(options.start.size() > 0 ? options.start : Matrix3Xd::Zero(3, energy.node_count())),
      change_(conditions.constrained.select(conditions.imposed - start_, 0.0)),
      index_(3 * static_cast<std::size_t>(energy.node_count()), -1),
      u_(start_) {
    for (int d = 0; d < 3 * energy.node_count(); ++d) {
        if (conditions.constrained.data()[d]) continue;
        index_[static_cast<std::size_t>(d)] = static_cast<int>(node_of_.size());
        node_of_.push_back(d / 3);
    }
}

NewtonResult Newton::run() {
    constexpr double smallest_increment = 1e-6, loose = 1e-2;
    const double increment = 1.0 / options_.load_steps;
    while (load_factor_ < 1.0) {
        const double before = load_factor_;
        raise_load(std::min(increment, 1.0 - before));
        if (load_factor_ < 1.0 && load_factor_ - before < smallest_increment * increment) {
            fail("the load cannot be raised without turning a tetrahedron inside out");
        }
        const bool last = load_factor_ >= 1.0;
        equilibrate(last ? options_.tolerance_mm : std::max(options_.tolerance_mm, loose * last_raise_mm_));
    }
    result_.displacement = u_;
    return std::move(result_);
}

double Newton::potential(const Matrix3Xd& u) const {
    Matrix3Xd resistance = Matrix3Xd::Zero(3, energy_.node_count());
    detail::add_spring_resistance(conditions_, u, resistance);
    return energy_.energy(u) + u.cwiseProduct(0.5 * resistance - force_factor() * applied_).sum();
}

Matrix3Xd Newton::residual(const Matrix3Xd& u) const {
    Matrix3Xd resistance = energy_.force(u);
    detail::add_spring_resistance(conditions_, u, resistance);
    return force_factor() * applied_ - resistance;
}

VectorXd Newton::reduced(const Matrix3Xd& x) const {
    VectorXd result(static_cast<Eigen::Index>(node_of_.size()));
    for (std::size_t d = 0; d < index_.size(); ++d) {
        if (index_[d] >= 0) result[index_[d]] = x.data()[d];
    }
    return result;
}

Matrix3Xd Newton::expanded(const VectorXd& x) const {
    Matrix3Xd result = Matrix3Xd::Zero(3, energy_.node_count());
    for (std::size_t d = 0; d < index_.size(); ++d) {
        if (index_[d] >= 0) result.data()[d] = x[index_[d]];
    }
    return result;
}

// Factor of K + springs (+ σ |diagonal| with the smallest tried σ that makes it positive definite). Returns the lower
// triangle of K + springs.
detail::BlockRows Newton::factorise(const Matrix3Xd& u) {
    constexpr double first_shift = 1e-3, shift_growth = 4.0, last_shift = 1e4;
    detail::BlockRows rows = energy_.stiffness(u);
    for (int s = 0; s < static_cast<int>(conditions_.spring_node.size()); ++s) {
        const int node = conditions_.spring_node[static_cast<std::size_t>(s)];
        rows.diagonal(node) += detail::spring_matrix(conditions_, s);
    }
    if (node_of_.empty()) return rows;
    Eigen::SparseMatrix<double> lower = detail::scalar_matrix(rows, index_, detail::Triangle::Lower);
    if (!factor_) factor_ = std::make_unique<detail::CholmodFactor>(lower, node_of_);
    const VectorXd diagonal = lower.diagonal();
    for (double shift = first_shift; !factor_->factorize(lower); shift *= shift_growth) {
        if (shift > last_shift) fail("no shift of the diagonal makes the tangent stiffness positive definite");
        lower.diagonal() = diagonal + shift * diagonal.cwiseAbs();
    }
    return rows;
}

// Adds up to `increment` to the load factor along the tangent: du_c = increment · change and
// K_ff du_f = increment · applied_f − K_fc du_c, as far as every J stays above a part of its present value.
void Newton::raise_load(double increment) {
    constexpr double kept_J = 0.2;
    const detail::BlockRows K = factorise(u_);
    Matrix3Xd direction = increment * change_;
    if (factor_) {
        Matrix3Xd force = -multiply(K, direction);
        if (options_.start.size() == 0) force += increment * applied_;
        direction += expanded(factor_->solve(reduced(force)));
    }
    const VectorXd J = energy_.jacobians(u_);
    double part = 1.0;
    for (int k = 0;
         k < max_backtracks && (energy_.jacobians(u_ + part * direction).array() <= kept_J * J.array()).any(); ++k) {
        part *= 0.5;
    }
    u_ += part * direction;
    load_factor_ += part * increment;
    if (load_factor_ > 1.0 - 1e-9) load_factor_ = 1.0;
    u_ = conditions_.constrained.select(start_ + load_factor_ * change_, u_);  // without the rounding of the sums
    last_raise_mm_ = part * direction.colwise().norm().maxCoeff();
}

// Newton's method at the present load factor.
void Newton::equilibrate(double tolerance_mm) {
    if (node_of_.empty()) return;
    for (int iteration = 0; iteration < options_.max_iterations; ++iteration) {
        observer_.checkpoint("Newton", load_factor_);
        const VectorXd force = reduced(residual(u_));
        static_cast<void>(factorise(u_));
        const VectorXd correction = factor_->solve(force);
        const Matrix3Xd direction = expanded(correction);
        const double step = line_search(direction, -force.dot(correction));
        u_ += step * direction;
        ++result_.iterations;
        result_.last_correction_mm = step * direction.colwise().norm().maxCoeff();
        if (step == 1.0 && result_.last_correction_mm <= tolerance_mm) return;
    }
    fail("no convergence in " + std::to_string(options_.max_iterations) + " iterations");
}

// Largest of 1, ½, ¼ … that keeps J > 0 (the energy is +∞ elsewhere) and lowers the potential as Armijo's rule asks, up
// to the rounding of the potential.
double Newton::line_search(const Matrix3Xd& direction, double slope) {
    constexpr double armijo = 1e-4, rounding = 1e-12;
    const double start = potential(u_);
    const double scale = std::abs(energy_.energy(u_)) + std::abs(force_factor() * u_.cwiseProduct(applied_).sum());
    for (int k = 0; k < max_backtracks; ++k) {
        const double step = std::ldexp(1.0, -k);
        if (potential(u_ + step * direction) <= start + armijo * step * slope + rounding * scale) return step;
    }
    fail("the line search found no step that lowers the potential");
}

void Newton::fail(const std::string& cause) const {
    const ElementJacobian smallest = smallest_element_jacobian(energy_, u_);
    throw SolverFailure("Newton's method stopped: " + cause + "; last good state: load factor " +
                        std::to_string(load_factor_) + ", " + std::to_string(result_.iterations) +
                        " iterations, last correction " + std::to_string(result_.last_correction_mm) +
                        " mm, smallest det F " + std::to_string(smallest.value) + " in element " +
                        std::to_string(smallest.element) + ". Use more load steps or smaller displacements");
}

}  // namespace

NewtonResult newton_equilibrium(const DiscreteEnergy& energy, const NodalConditions& conditions,
                                const NewtonOptions& options, Observer& observer) {
    if (options.load_steps < 1 || options.max_iterations < 1 || !(options.tolerance_mm > 0.0)) {
        throw InvalidInput(
            "Newton's options need load_steps and max_iterations of at least 1 and a positive tolerance");
    }
    if (conditions.constrained.cols() != energy.node_count()) {
        throw InvalidInput("conditions of " + std::to_string(conditions.constrained.cols()) +
                           " nodes do not fit a discretisation of " + std::to_string(energy.node_count()));
    }
    if (options.start.size() > 0 && options.start.cols() != energy.node_count()) {
        throw InvalidInput("Newton's start has " + std::to_string(options.start.cols()) + " nodes instead of " +
                           std::to_string(energy.node_count()));
    }
    return Newton(energy, conditions, options, observer).run();
}

NewtonResult newton_equilibrium(const RestState& rest, const NodalConditions& conditions, const NewtonOptions& options,
                                Observer& observer) {
    detail::require_held(rest, conditions);
    return newton_equilibrium(LinearTetrahedra(rest), conditions, options, observer);
}

}  // namespace tissuewarp::tled
