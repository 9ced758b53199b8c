#pragma once
/// A registration minimises E(u) = W(u) + Σ_terms ½ rᵀ Λ r, W the strain energy (docs/method.md). A term is a kind of
/// datum, or what is expected where there is none, or what holds the tissue: it says where the organ lies, what it asks
/// of the solver in a round, and how the result agrees with it. It knows no other term.

#include "core/observer.hpp"
#include "registration/pose/robust_weight.hpp"
#include "registration/result.hpp"
#include "registration/schedule.hpp"
#include "registration/state.hpp"
#include "registration/terms/datum_kind.hpp"

#include <optional>
#include <vector>

namespace tissuewarp::registration::detail {

/// What a term asks of a round: springs and forces on nodes, linearised about where the model is.
struct Contribution {
    std::vector<PulledNode> springs;
    Eigen::Matrix3Xd forces = {};  ///< on the nodes, 3 × N, mN; 3 × 0: none
    bool pulls_anew = false;       ///< by other springs than in the round before: what relaxes slowest has changed
    int candidates = 0, matched = 0;
    int held_back = 0;            ///< matches further away than the round's step bound
    double mean_residual_mm = 0;  ///< weighted, before the round's equilibrium
};

/// Terms together: springs and forces add up, the residual is the mean over matches.
void add(Contribution& sum, Contribution more);

/// Springs with what they stand for.
std::vector<PulledNode> pulled_by(Origin origin, const std::vector<tled::Spring>& springs);

/// Springs of data.
std::vector<PulledNode> pulled_by(const DatumKind& kind, const std::vector<tled::Spring>& springs);

/// What a term shows of the organ; decides what else a registration needs (terms.hpp).
enum class Shows {
    Nothing,   ///< no datum
    Parts,     ///< points of it: nothing is known of the rest, nor, without alignment data, where it lies
    Boundary,  ///< all of its surface
    Volume,    ///< grey values; expects by itself how tissue out of view moved
    Place      ///< where it lies as a whole, as bone that it touches does
};

/// What a term says of the rigid placement, from nothing to all of it. The term that says most places the organ.
enum class PoseClaim {
    None,
    Search,       ///< by what a first search from the headers' placement finds
    Shift,        ///< how far it moved, not how it turned
    NearStart,    ///< the nearest pose to a start that fits
    Anywhere,     ///< wherever it lies
    Pairs,        ///< from corresponding points
    WholeSurface  ///< from all of its boundary
};

class Term {
public:
    Term() = default;
    Term(const Term&) = delete;
    Term& operator=(const Term&) = delete;
    virtual ~Term() = default;

    [[nodiscard]] virtual Shows shows() const { return Shows::Nothing; }

    [[nodiscard]] virtual PoseClaim pose_claim() const { return PoseClaim::None; }
    /// The rigid placement, near `start` where the claim is no more than that. Throws InvalidInput, Cancelled.
    [[nodiscard]] virtual Alignment pose(const Eigen::Isometry3d& start, Observer& observer);

    /// Takes over what a search for the placement told an earlier update, in which its data were nearly the same. False
    /// where the search must be made again.
    [[nodiscard]] virtual bool take_over(const UpdateResult& /*last*/) { return true; }

    /// What its data tell badly of the placement.
    [[nodiscard]] virtual HardlyTold hardly_told() const { return {}; }

    /// Whether the placement is a motion that its data made, which the prior then moves along with.
    [[nodiscard]] virtual bool has_placed() const { return false; }

    /// Searches of an image that the rounds are to make room for.
    [[nodiscard]] virtual int searches() const { return 0; }
    /// Whether a further search may bring the model nearer.
    [[nodiscard]] virtual bool gains() const { return false; }

    /// Springs and forces of a round. Throws InvalidInput where the data meet the model nowhere, Cancelled.
    [[nodiscard]] virtual Contribution linearise(const RoundPlan& plan, const State& state, Observer& observer) = 0;

    /// Takes note of an equilibrium under what linearise() asked for. Whether that changed what the term asks for, so
    /// that the equilibrium is to be sought again from where it started.
    [[nodiscard]] virtual bool follow(const State& /*solved*/) { return false; }
    /// Whether nothing is left to follow.
    [[nodiscard]] virtual bool settled(const State& /*state*/) const { return true; }

    /// Writes to the result how it agrees with the term, and what the term has against it.
    virtual void judge(const State& /*state*/, UpdateResult& /*result*/) {}
};

/// How points of a surface, pairs and points along vessels are matched and weighed from round to round. Chosen by hand;
/// on which data is not recorded.
struct RobustRounds {
    double falling = 0.6;            ///< the scale of a round over that of the round before, down to the final one
    double first_percentile = 0.9;   ///< of a surface's first distances, as a share; robust against fewer outliers
    double first_of_percentile = 2;  ///< the first scale of a surface over that distance
    double first_of_median = 3;      ///< the first scale of pairs and curves over their median distance
    double reach_of_scale = 4;       ///< matches are sought so many final scales far, where a weight is 1/289 …
    double reach_of_range = 3;       ///< … and as many search ranges of the round
    double held_back_weight = 0.5;   ///< a match counts as held back where it weighs more
};
inline constexpr RobustRounds robust_rounds{};

/// Points after their robust scale: from a wide one in the first round, falling by 0.6 a round to the final one.
class FallingScale {
public:
    /// Precondition: the first round's scale is given before the others are asked for.
    void begin_at(double scale_mm) { first_mm_ = scale_mm; }
    [[nodiscard]] double of(const RoundPlan& plan, double final_mm) const;

private:
    double first_mm_ = 0;
};

}  // namespace tissuewarp::registration::detail
