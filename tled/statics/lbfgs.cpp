// L-BFGS (Liu and Nocedal, Math. Program. 45 (1989) 503–528; two-loop recursion: Nocedal and Wright, Numerical
// Optimization (2006), algorithm 7.4) with B = K₀⁻¹, by CHOLMOD's factor, as first metric. B is linear, so that B y of
// the stored pairs follows from the lifted residuals B r of their ends: one triangular solve an iteration gives the
// direction, the scale of the metric and the estimate of the error.

#include "tled/statics/equilibrium_search.hpp"
#include "tled/statics/line_search.hpp"
#include "tled/stiffness/dot.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <optional>
#include <utility>

namespace tissuewarp::tled::detail {

using Eigen::Matrix3Xd;

namespace {

constexpr std::size_t most_pairs = 30;
constexpr int most_idle_iterations = 25;  // without the error falling by a tenth
constexpr double volume_dominated = 200;  // volumetric over shear modulus, ν = 0.4975

/// A step s, the fall of the residual y over it, and B y.
struct Pair {
    Matrix3Xd s, y, By;
    double ys;
};

/// Estimates the error from the lifted residuals δ_k = ‖B r_k‖∞, of which one alone swings by a factor of four about
/// it. With the mean contraction q of an iteration, δ is the largest of the last three, each carried on by q; the
/// corrections to come are conjugate, so that e² ≈ Σ δ² = δ²/(1 − q²) (Strakoš and Tichý, BIT 45 (2005), for linear
/// problems).
class ErrorHistory {
public:
    explicit ErrorHistory(double first_correction_mm) : lifted_{first_correction_mm} {}
    void add(double lifted_mm) { lifted_.push_back(lifted_mm); }
    [[nodiscard]] double estimate() const {
        constexpr double slowest = 0.97;
        const std::size_t last = lifted_.size() - 1;
        if (last < 2) return linear_start_safety * lifted_.back();
        const double q = std::min(slowest, std::pow(lifted_.back() / lifted_.front(), 1.0 / static_cast<double>(last)));
        const double delta = std::max({lifted_[last], q * lifted_[last - 1], q * q * lifted_[last - 2]});
        return delta / std::sqrt(1 - q * q);
    }

private:
    std::vector<double> lifted_;
};

/// Is there tissue whose volume is so stiff that K₀, which knows it only at rest, is a poor metric?
bool dominated_by_volume(const RestState& rest) {
    return rest.pressure.count() > 0 && std::any_of(rest.materials.begin(), rest.materials.end(), [](const auto& each) {
               return volumetric_modulus(each) > volume_dominated * shear_modulus(each);
           });
}

class Lbfgs {
public:
    explicit Lbfgs(EquilibriumSearch& search) : search_(search) {}

    EquilibriumResult run(const Matrix3Xd* start) {
        u_ = search_.begin(start);
        require(search_.admissible(u_));
        r_ = search_.residual();
        Br_ = search_.lifted(r_);
        ErrorHistory history(search_.correction_mm());
        history.add(largest_norm(Br_));
        double least = history.estimate();
        for (int idle = 0;; ++idle) {
            const double error = history.estimate();
            search_.keep(u_, error);
            if (error <= search_.options.tolerance_mm) return search_.finish();
            if (error < 0.9 * least) {
                least = error;
                idle = 0;
            }
            if (idle > most_idle_iterations) search_.fail_stalled();
            if (!fresh_ && search_.options.rest != nullptr && dominated_by_volume(*search_.options.rest)) refresh();
            advance();
            history.add(largest_norm(Br_));
        }
    }

private:
    EquilibriumSearch& search_;
    Matrix3Xd u_, r_, Br_;
    std::deque<Pair> pairs_;
    std::optional<RestStiffness> fresh_;

    void require(bool admissible) const {
        if (!admissible) search_.fail_stalled();
    }

    [[nodiscard]] Matrix3Xd lifted(const Matrix3Xd& residual) {
        return fresh_ ? fresh_->solve(residual) : search_.lifted(residual);
    }

    void refresh() {
        fresh_.emplace(*search_.options.rest, search_.conditions, u_);
        search_.observer.note(
            "L-BFGS: metric factorised anew at the start, because the tissue is nearly incompressible");
        Br_ = lifted(r_);
    }

    /// H r. The scale s·y / y·By fits the metric to the stiffness along the last step.
    [[nodiscard]] Matrix3Xd direction() const {
        Matrix3Xd q = r_, d = Br_;
        std::vector<double> a(pairs_.size());
        for (std::size_t i = pairs_.size(); i-- > 0;) {
            a[i] = dot(pairs_[i].s, q) / pairs_[i].ys;
            q -= a[i] * pairs_[i].y;
            d -= a[i] * pairs_[i].By;
        }
        if (!pairs_.empty()) d *= pairs_.back().ys / dot(pairs_.back().y, pairs_.back().By);
        for (std::size_t i = 0; i < pairs_.size(); ++i) d += (a[i] - dot(pairs_[i].y, d) / pairs_[i].ys) * pairs_[i].s;
        return d;
    }

    void advance() {
        Matrix3Xd d = direction();
        std::optional<LineStep> step = line_search(search_, u_, r_, d);
        if (!step && !pairs_.empty()) {
            pairs_.clear();
            d = Br_;
            step = line_search(search_, u_, r_, d);
        }
        if (!step) search_.fail_stalled();
        const Matrix3Xd s = step->length * d, y = r_ - step->residual;
        u_ += s;
        r_ = std::move(step->residual);
        const Matrix3Xd before = Br_;
        Br_ = lifted(r_);
        Pair pair{s, y, before - Br_, dot(s, y)};
        if (!(pair.ys > 0) || !(dot(pair.y, pair.By) > 0)) return;
        pairs_.push_back(std::move(pair));
        if (pairs_.size() > most_pairs) pairs_.pop_front();
    }
};

}  // namespace

EquilibriumResult lbfgs(EquilibriumSearch& search, const Matrix3Xd* start) {
    return Lbfgs(search).run(start);
}

}  // namespace tissuewarp::tled::detail
