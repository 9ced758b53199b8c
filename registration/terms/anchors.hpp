#pragma once
/// Labels of a preoperative map that are no tissue to deform, or tissue that stays.

#include "registration/terms/term.hpp"

namespace tissuewarp::registration::detail {

/// The bodies of these labels, none where no label is given. Precondition: require_surroundings.
std::optional<RigidNeighbours> rigid_neighbours(const imaging::Volume& map, const std::vector<int>& labels);

/// Both kinds of labels in one map again, as `prepare` takes it.
imaging::Volume with_neighbours(const PreparedModel& prepared);

/// What was seen with the rigid neighbours taken out of its labels, if it has any: they are background there as they
/// are in the model.
Intraoperative without_neighbours(const Intraoperative& seen, const std::vector<int>& labels);

/// Nodes of the mesh that belong to a tetrahedron of an anchor, ascending.
std::vector<int> anchored_nodes(const PreparedModel& prepared);

/// Anchors or rigid neighbours say where the organ lies as a whole.
bool is_held(const PreparedModel& prepared);

/// Springs that hold every anchored node where the rigid placement has it, to 0.1 mm: `energy` (mN mm) is the strain
/// energy that weighs as much as one standard deviation.
std::vector<tled::Spring> anchor_springs(const PreparedModel& prepared, double energy);

/// How far they moved nevertheless.
AnchorFit anchor_fit(const PreparedModel& prepared, const State& state);

}  // namespace tissuewarp::registration::detail
