#pragma once
/// The rigid motion in a displacement, given to the placement.

#include "registration/detail/evidence.hpp"

namespace tissuewarp::registration::detail {

/// Moves the placement by the rigid motion that comes closest to the displacement of the outer surface (least squares
/// by area: Kabsch, Acta Cryst A 32 (1976) 922) and leaves the rest to the displacement; no tissue moves. The ground,
/// whose springs have the same weights, then pulls the organ nowhere as a whole.
void give_rigid_part_to_placement(const PreparedModel& prepared, State& state);

}  // namespace tissuewarp::registration::detail
