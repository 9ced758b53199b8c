#pragma once
/// A part of a model simulated in place of the whole: the tissue far from what is asked for becomes springs.

#include "tled/conditions.hpp"
#include "tled/model.hpp"

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

/// The tetrahedra marked in `keep` (one entry each), under the conditions that act on their nodes. Where they meet the
/// others, every node takes a spring and a force: the row sums of the others' condensed stiffness (Guyan 1965), so that
/// a common translation of the interface meets the right force, and what their loads, at rest, do to an interface that
/// is held. `targets` are nodes of the whole, all of which must be kept.
///
/// Throws InvalidInput for sizes that differ, nothing kept, a target that is left out, hexahedra, or effects other than
/// fluid and contact on nodes that are left out; also where nothing holds the whole.
Region region_of(const Model& whole, const Conditions& conditions, const std::vector<bool>& keep,
                 const std::vector<int>& targets);

}  // namespace tissuewarp::tled
