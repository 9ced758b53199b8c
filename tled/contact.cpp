#include "tled/contact.hpp"

#include "core/errors.hpp"
#include "tled/damped_motion.hpp"
#include "tled/load_path.hpp"
#include "tled/statics/one_sided_contact.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::tled {
namespace {

using detail::ContactNode, detail::Gap, detail::Touch;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;

/// A pair that may part.
struct Pair {
    bool closed = true;
    int openings = 0;
};

class Rounds {
public:
    Rounds(Engine& engine, const RestState& rest, const NodalConditions& conditions, const ContactOptions& options,
           Observer& observer)
        : engine_(engine),
          rest_(rest),
          free_(conditions),
          stated_(conditions.effects.surface),
          options_(options),
          observer_(observer),
          pairs_(stated_.parting.size()) {
        if (conditions.effects.contact) contact_ = *conditions.effects.contact;
        free_.effects.contact.reset();
        decide_pairs();
        const Matrix3Xd diagonal = without_springs_->diagonal(free_);
        for (std::size_t i = 0; i < contact_.node.size(); ++i)
            candidates_.push_back({contact_.node[i], contact_.rest_position.col(static_cast<Eigen::Index>(i)),
                                   options.stiffness * diagonal.col(contact_.node[i]).mean()});
        touches_.resize(candidates_.size());
    }

    ContactResult run(const Matrix3Xd* start) {
        Matrix3Xd u = start ? *start : Matrix3Xd::Zero(3, rest_.node_count);
        begin(u, 0);
        if (!start) approach(u);
        return rounds(u, start);
    }

    /// From tissue that lies on the bodies already, with springs that push alone, so many times as stiff.
    ContactResult run_resting(Matrix3Xd u, double stiffer) {
        begin(u, 0.1);
        one_sided_ = true;
        stiffen(stiffer);
        press(u);
        return rounds(u, &u);
    }

private:
    ContactResult rounds(Matrix3Xd& u, const Matrix3Xd* start) {
        double apart_before = std::numeric_limits<double>::infinity();
        for (result_.rounds = 1;; ++result_.rounds) {
            solve(u, result_.rounds == 1 ? start : &u);
            const bool others_touch = follow_bodies(u), pairs_changed = follow_pairs(u);
            const double apart = one_sided_ ? std::max(largest_gap(u), largest_penetration(u)) : largest_gap(u);
            if (!pairs_changed && (one_sided_ || !others_touch) && apart <= options_.penetration_mm) break;
            if (result_.rounds == options_.most_rounds) fail(u);
            observer_.checkpoint("contact", static_cast<double>(result_.rounds) / options_.most_rounds);
            if (one_sided_ && apart > 0.25 * apart_before) stiffen(10);
            apart_before = apart;
        }
        report(u);
        return std::move(result_);
    }

    [[nodiscard]] Gap gap(const ContactNode& candidate, std::size_t obstacle, const Matrix3Xd& u) const {
        return detail::gap_to(contact_.obstacles[obstacle], candidate.X + u.col(candidate.node));
    }

    /// Which nodes will touch, by linear elasticity, and where tissue will about be: from rest it falls until those
    /// that touch carry it. Without them tissue that only soft springs hold sinks through the bodies, as far as no
    /// equilibrium of theirs leads back.
    void approach(Matrix3Xd& u) {
        constexpr int most_stops = 20;
        for (int stop = 0; stop < most_stops; ++stop) {
            const NodalConditions conditions = with_touches(u);
            const Matrix3Xd way = RestStiffness(rest_, conditions, *without_springs_).linear_solution(conditions) - u;
            const double part = part_until_deep(u, way);
            u += part * way;
            follow_bodies(u);
            if (part == 1) return;
        }
    }

    /// The part of the way after which a node that did not touch is half an edge deep.
    [[nodiscard]] double part_until_deep(const Matrix3Xd& u, const Matrix3Xd& way) const {
        const double deep = std::cbrt(rest_.volume.mean());
        const auto is_deep = [&](double part) {
            const Matrix3Xd there = u + part * way;
            for (std::size_t i = 0; i < candidates_.size(); ++i)
                if (const auto obstacle = deepest_obstacle(candidates_[i], there);
                    obstacle && !touches_[i] && gap(candidates_[i], *obstacle, there).distance < -deep)
                    return true;
            return false;
        };
        // Sampled densely, since far on its way tissue may have left what is known of a body, or the body itself.
        constexpr double most_samples = 1024;
        constexpr int halvings = 10;
        const double samples = std::clamp(std::ceil(way.colwise().norm().maxCoeff() / deep), 1.0, most_samples);
        double shallow = 0, part = 0;
        for (double k = 1; !is_deep(part = k / samples); ++k) {
            if (k >= samples) return 1;
            shallow = part;
        }
        for (int halving = 0; halving < halvings; ++halving) {
            const double middle = 0.5 * (shallow + part);
            (is_deep(middle) ? part : shallow) = middle;
        }
        return part;
    }

    void solve(Matrix3Xd& u, const Matrix3Xd* start) {
        EquilibriumResult found = one_sided_ ? solved_one_sided(u) : solved_held(u, start);
        found.force_evaluations += result_.equilibrium.force_evaluations;
        found.lifted_residuals += result_.equilibrium.lifted_residuals;
        u = found.displacement;
        result_.equilibrium = std::move(found);
    }

    /// With nodes that touch held to the surface by their springs; from `start`, or from rest, by way of smaller loads
    /// where all is too much at once.
    [[nodiscard]] EquilibriumResult solved_held(const Matrix3Xd& u, const Matrix3Xd* start) const {
        const NodalConditions conditions = with_touches(u);
        EquilibriumOptions options = options_.equilibrium;
        if (result_.equilibrium.method == EquilibriumMethod::Newton) {  // others failed
            options.method = EquilibriumMethod::Newton;
            options.tolerance_mm = tolerance_of_newton_mm();
        }
        return equilibrium_along_load(engine_, RestStiffness(rest_, conditions, *without_springs_), conditions,
                                      {.equilibrium = options}, start, observer_);
    }

    /// With contact that pushes alone, from where tissue is: it may roll on to other nodes, and flatten.
    [[nodiscard]] EquilibriumResult solved_one_sided(const Matrix3Xd& u) const {
        const detail::OneSidedContact contact(contact_.obstacles, candidates_, touches_);
        EquilibriumOptions options = options_.equilibrium;
        options.method = EquilibriumMethod::Newton;
        options.rest = &rest_;
        options.one_sided = &contact;
        options.tolerance_mm = tolerance_of_newton_mm();
        return equilibrium(engine_, RestStiffness(rest_, with_touches(u), *without_springs_), free_, options, &u,
                           observer_);
    }

    /// A start within the tolerance is taken as it is, and the springs' ends would move on without the tissue.
    [[nodiscard]] double tolerance_of_newton_mm() const {
        return std::min(options_.equilibrium.tolerance_mm, 0.5 * options_.penetration_mm);
    }

    /// The springs of the touching nodes at `u`, each towards a point `push` beyond the surface.
    [[nodiscard]] NodalConditions with_touches(const Matrix3Xd& u) const {
        std::vector<Spring> springs;
        for (std::size_t i = 0; i < candidates_.size(); ++i) {
            if (!touches_[i]) continue;
            const ContactNode& candidate = candidates_[i];
            const Gap here = gap(candidate, touches_[i]->obstacle, u);
            springs.push_back({candidate.node, candidate.stiffness * here.normal * here.normal.transpose(),
                               u.col(candidate.node) + (touches_[i]->push - here.distance) * here.normal});
        }
        return with_springs(free_, springs);
    }

    /// Nodes within `near` (mm) of a body touch it.
    void begin(const Matrix3Xd& u, double near) {
        follow_bodies(u, near);
        for (std::size_t p = 0; p < pairs_.size(); ++p) pairs_[p].closed = overlap(stated_.parting[p], u) >= 0;
        decide_pairs();
    }

    /// Touching nodes push as much as tissue at rest there presses.
    void press(const Matrix3Xd& u) {
        engine_.set_conditions(free_);
        engine_.set_state(u, Matrix3Xd::Zero(3, u.cols()));
        const Matrix3Xd missing = engine_.residual();
        for (std::size_t i = 0; i < candidates_.size(); ++i) {
            if (!touches_[i]) continue;
            const ContactNode& candidate = candidates_[i];
            const Vector3d normal = gap(candidate, touches_[i]->obstacle, u).normal;
            touches_[i]->push = std::max(0.0, -missing.col(candidate.node).dot(normal) / candidate.stiffness);
        }
    }

    /// Stiffer springs under the same forces: tissue that may roll settles where they resist more than its weight
    /// drives it on (Nocedal and Wright 2006, algorithm 17.4).
    void stiffen(double times) {
        for (ContactNode& candidate : candidates_) candidate.stiffness *= times;
        for (std::optional<Touch>& touch : touches_)
            if (touch) touch->push /= times;
    }

    void decide_pairs() {
        std::vector<bool> closed;
        for (const Pair& pair : pairs_) closed.push_back(pair.closed);
        free_.effects.surface = with_pairs_decided(stated_, closed);
        without_springs_.emplace(rest_, free_);
    }

    /// Lets pairs go that are pulled and holds those that overlap; whether any has changed. Each time that a pair was
    /// let go it may overlap a little more before it is held again: else one without force would open and close for
    /// ever.
    bool follow_pairs(const Matrix3Xd& u) {
        bool changed = false;
        for (std::size_t p = 0; p < pairs_.size(); ++p) {
            Pair& pair = pairs_[p];
            const double g = overlap(stated_.parting[p], u);
            const bool closed = pair.closed ? g >= 0 : g > 0.1 * options_.penetration_mm * pair.openings;
            if (closed == pair.closed) continue;
            pair.closed = closed;
            pair.openings += closed ? 0 : 1;
            changed = true;
        }
        if (changed) decide_pairs();
        return changed;
    }

    /// Moves the ends of the springs on, lets go and takes hold; whether the set of touching nodes has changed.
    bool follow_bodies(const Matrix3Xd& u, double near = 0) {
        bool changed = false;
        for (std::size_t i = 0; i < candidates_.size(); ++i) {
            std::optional<Touch>& touch = touches_[i];
            if (touch) {
                touch->push -= gap(candidates_[i], touch->obstacle, u).distance;
                if (touch->push > 0) continue;
                touch.reset();
                changed = true;
            } else if (const std::optional<std::size_t> entered = deepest_obstacle(candidates_[i], u, near)) {
                touch = Touch{*entered, one_sided_ ? -std::min(0.0, gap(candidates_[i], *entered, u).distance) : 0.0};
                changed = true;
            }
        }
        return changed;
    }

    [[nodiscard]] std::optional<std::size_t> deepest_obstacle(const ContactNode& candidate, const Matrix3Xd& u,
                                                              double near = 0) const {
        std::optional<std::size_t> found;
        double deepest = near;
        for (std::size_t o = 0; o < contact_.obstacles.size(); ++o)
            if (const double distance = gap(candidate, o, u).distance; distance < deepest) {
                deepest = distance;
                found = o;
            }
        return found;
    }

    /// Of touching nodes, to either side of the surface, mm.
    [[nodiscard]] double largest_gap(const Matrix3Xd& u) const {
        double largest = 0;
        for (std::size_t i = 0; i < candidates_.size(); ++i)
            if (touches_[i])
                largest = std::max(largest, std::abs(gap(candidates_[i], touches_[i]->obstacle, u).distance));
        return largest;
    }

    [[nodiscard]] double largest_penetration(const Matrix3Xd& u) const {
        double largest = 0;
        for (const ContactNode& candidate : candidates_)
            if (const auto obstacle = deepest_obstacle(candidate, u))
                largest = std::max(largest, -gap(candidate, *obstacle, u).distance);
        return largest;
    }

    void report(const Matrix3Xd& u) {
        result_.pressing =
            static_cast<int>(std::count_if(pairs_.begin(), pairs_.end(), [](const Pair& pair) { return pair.closed; }));
        result_.largest_penetration_mm = largest_penetration(u);
        result_.reaction = Matrix3Xd::Zero(3, rest_.node_count);
        for (std::size_t i = 0; i < candidates_.size(); ++i) {
            if (!touches_[i]) continue;
            ++result_.touching;
            const ContactNode& candidate = candidates_[i];
            result_.reaction.col(candidate.node) =
                candidate.stiffness * touches_[i]->push * gap(candidate, touches_[i]->obstacle, u).normal;
        }
    }

    [[noreturn]] void fail(const Matrix3Xd& u) const {
        throw SolverFailure("the contact does not settle: after " + std::to_string(result_.rounds) +
                            " rounds a node is " + std::to_string(largest_penetration(u)) +
                            " mm inside an obstacle, or pairs open and close; apply the load in parts, refine the mesh "
                            "at the contact, or take dynamics");
    }

    Engine& engine_;
    const RestState& rest_;
    NodalConditions free_;  // without contact, with the pairs as this round has them
    SurfaceEffects stated_;
    NodalContact contact_;  // without nodes where there are no bodies
    const ContactOptions& options_;
    Observer& observer_;
    std::optional<RestStiffness> without_springs_;
    std::vector<ContactNode> candidates_;
    std::vector<std::optional<Touch>> touches_;  // of each candidate
    std::vector<Pair> pairs_;                    // of SurfaceEffects::parting
    bool one_sided_ = false;                     // contact pushes alone
    ContactResult result_;
};

void require_usable(const NodalConditions& conditions, const ContactOptions& options) {
    const auto& contact = conditions.effects.contact;
    if (!contact && conditions.effects.surface.parting.empty())
        throw InvalidInput(
            "equilibrium in contact needs conditions with contact or pairs that may part: take equilibrium()");
    for (const Obstacle& obstacle : contact ? contact->obstacles : std::vector<Obstacle>{})
        if (obstacle.friction > 0)
            throw InvalidInput("an obstacle has a friction of " + std::to_string(obstacle.friction) +
                               ": where tissue comes to rest depends on its way then; take dynamics");
    if (!(options.penetration_mm > 0) || options.most_rounds < 1 || !(options.stiffness > 0))
        throw InvalidInput("contact needs a positive penetration (mm), a round and a positive stiffness at least");
}

}  // namespace

ContactResult equilibrium_in_contact(Engine& engine, const RestState& rest, const NodalConditions& conditions,
                                     const ContactOptions& options, const Eigen::Matrix3Xd* start, Observer& observer) {
    require_usable(conditions, options);
    try {
        return Rounds(engine, rest, conditions, options, observer).run(start);
    } catch (const SolverFailure& failure) {
        if (!rest.viscosity.empty()) throw;
        observer.note(std::string("contact by damped motion first: ") + failure.what());
    }
    const Matrix3Xd from = start ? *start : Matrix3Xd::Zero(3, rest.node_count);
    const auto loads = [&](double part) { return start ? conditions : scaled(conditions, part); };
    std::string cause;
    try {
        const Matrix3Xd resting = displacement_after_motion(engine, rest, loads, from, observer);
        // Of 20 scenes (rest and lie 21 to 30 of contact_sweep) these settle 18, 17 and 12 by themselves.
        for (const double stiffer : {10, 100, 1}) {
            try {
                return Rounds(engine, rest, conditions, options, observer).run_resting(resting, stiffer);
            } catch (const SolverFailure& failure) {
                cause = failure.what();
            }
        }
    } catch (const SolverFailure& failure) {
        cause = failure.what();
    }
    throw SolverFailure("no equilibrium in contact, also not from where damped motion leads (" + cause +
                        "); tissue that almost nothing keeps from rolling or sliding on a body needs more that holds "
                        "it, or dynamics");
}

}  // namespace tissuewarp::tled
