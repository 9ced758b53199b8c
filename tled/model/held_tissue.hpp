#pragma once
/// Is every piece of tissue kept from moving and turning as a rigid body?

#include "tled/conditions.hpp"
#include "tled/rest_state.hpp"

#include <vector>

namespace tissuewarp::tled::detail {

/// Nodes that elements connect with each other, piece by piece, in the order of the pieces' lowest nodes.
std::vector<std::vector<int>> connected_pieces(const RestState& rest);

/// Throws InvalidInput naming the first connected piece of the mesh with a rigid motion that neither springs nor
/// prescribed displacements resist, and nodes that no tetrahedron uses unless they are held.
void require_held(const RestState& rest, const NodalConditions& conditions);
/// With its pieces as they are known.
void require_held(const RestState& rest, const std::vector<std::vector<int>>& pieces,
                  const NodalConditions& conditions);

}  // namespace tissuewarp::tled::detail
