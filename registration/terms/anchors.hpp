#pragma once
/// Tissue that stays where the rigid placement has it.

#include "registration/prepare.hpp"
#include "registration/terms/term.hpp"

#include <vector>

namespace tissuewarp::registration::detail {

/// Nodes of the mesh that belong to a tetrahedron of an anchor, ascending.
std::vector<int> anchored_nodes(const PreparedModel& prepared);

/// Anchors or rigid neighbours say where the organ lies as a whole.
bool is_held(const PreparedModel& prepared);

/// How anchors hold and what is said of it. Chosen by hand; on which data is not recorded.
struct AnchorOptions {
    double deviation_mm = 0.1;  ///< of an anchored node from the placement: it hardly moves
    double most_pull_mm = 0.5;  ///< of any node, beyond which data and anchors contradict each other
};
inline constexpr AnchorOptions anchor_options{};

class AnchorTerm : public Term {
public:
    /// Springs hold every anchored node to 0.1 mm: `energy` (mN mm) is the strain energy that weighs as much as one
    /// standard deviation.
    AnchorTerm(const PreparedModel& prepared, double energy);

    [[nodiscard]] Shows shows() const override { return springs_.empty() ? Shows::Nothing : Shows::Place; }
    [[nodiscard]] Contribution linearise(const RoundPlan& plan, const State& state, Observer& observer) override;
    /// How far they moved nevertheless.
    void judge(const State& state, UpdateResult& result) override;

private:
    std::vector<PulledNode> springs_;
};

}  // namespace tissuewarp::registration::detail
