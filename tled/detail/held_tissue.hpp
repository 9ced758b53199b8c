#pragma once
/// Is every piece of tissue kept from moving and turning as a rigid body?

#include "tled/conditions.hpp"
#include "tled/rest_state.hpp"

namespace tissuewarp::tled::detail {

/// Throws InvalidInput naming the first connected piece of the mesh with a rigid motion that neither springs nor
/// prescribed displacements resist, and nodes that no tetrahedron uses unless they are held.
void require_held(const RestState& rest, const NodalConditions& conditions);

}  // namespace tissuewarp::tled::detail
