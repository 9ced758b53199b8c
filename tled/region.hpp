#pragma once
/// A part of a model simulated in place of the whole: the tissue far from what is asked for becomes springs.

#include "tled/conditions.hpp"
#include "tled/model.hpp"

#include <memory>
#include <vector>

namespace tissuewarp::tled {

struct Region {
    Model model;
    std::vector<int> node_of;  ///< node of the region → node of the whole, ascending
    Conditions conditions;     ///< those of the region's nodes, and what the rest of the tissue does to them
    /// Largest difference at the targets between the linear-elastic answers of region and whole, mm. What it cannot
    /// know is how far the tissue left out is from linear.
    double estimated_change_mm = 0.0;
};

/// What the tissue left out does at the nodes where it meets the region: springs, and forces that follow its loads.
class FarTissue {
public:
    /// All tetrahedra but those marked in `keep`, and what holds them: what is prescribed, and springs, must be the
    /// same in later conditions. Throws InvalidInput as region_of() does.
    FarTissue(const Model& whole, const Conditions& conditions, const std::vector<bool>& keep);
    ~FarTissue();

    /// Of the whole, ascending: those where both meet and nothing is prescribed.
    [[nodiscard]] const std::vector<int>& nodes() const;
    /// At these nodes: the row sums of the condensed stiffness.
    [[nodiscard]] std::vector<Spring> springs(const Conditions& conditions) const;
    /// On these nodes at rest, mN: of weight, lift, springs and imposed displacements of the far tissue.
    [[nodiscard]] Eigen::Matrix3Xd force(const Conditions& conditions) const;

private:
    friend Region region_of(const Model& whole, const Conditions& conditions, const FarTissue& far,
                            const std::vector<int>& targets, const Eigen::Matrix3Xd& answer);
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// Linear-elastic displacement at rest, lift, pressures and membranes as they are there, 3 × N mm.
Eigen::Matrix3Xd linear_answer(const Model& model, const Conditions& conditions);

/// The tetrahedra marked in `keep` (one entry each), under the conditions that act on their nodes. Where they meet the
/// others, every node takes a spring and a force: the row sums of the others' condensed stiffness (Guyan 1965), so that
/// a common translation of the interface meets the right force, and what their loads, at rest, do to an interface that
/// is held. `targets` are nodes of the whole, all of which must be kept.
///
/// Throws InvalidInput for sizes that differ, nothing kept, a target that is left out, hexahedra, or effects other than
/// fluid and contact on nodes that are left out; also where nothing holds the whole.
Region region_of(const Model& whole, const Conditions& conditions, const std::vector<bool>& keep,
                 const std::vector<int>& targets);

/// The same where the far tissue and the linear answer of the whole are known.
Region region_of(const Model& whole, const Conditions& conditions, const FarTissue& far,
                 const std::vector<int>& targets, const Eigen::Matrix3Xd& answer);

}  // namespace tissuewarp::tled
