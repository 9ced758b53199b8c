#pragma once
/// The mesh in patches: compact sets of tetrahedra whose nodes fit into the memory that the invocations of one
/// workgroup share. Inside a patch the tetrahedra form fans around common edges, so that a fan loads and leaves each of
/// its nodes once: 1.8 nodes a tetrahedron on usual meshes instead of four.

#include "tled/rest_state.hpp"

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace tissuewarp::tled::detail {

/// Most tetrahedra of a fan: eight local nodes of 16 bits are one load of 16 bytes.
inline constexpr int most_of_a_fan = 5;

struct PatchShape {
    int tets = 1000;                  ///< of a patch, at most
    int longest_fan = most_of_a_fan;  ///< 1 … most_of_a_fan: shorter fans are more work on more invocations
};

/// Tetrahedra (a, b, c_i, c_{i+1}), i = 0 … length − 1, positively oriented, around the edge a b; c_0 = c_length where
/// the ring closes. Numbers are local to the patch.
struct Fan {
    int a = 0, b = 0;
    std::array<int, most_of_a_fan + 1> ring{};
    int length = 0;
    std::array<int, most_of_a_fan> tet{};  ///< places in the list of tetrahedra that the fan was made of
};

/// Tetrahedra of one material. Nodes that more patches share come first.
struct Patch {
    int material = 0;       ///< index into RestState::materials
    std::vector<int> tet;   ///< internal elements of the rest state
    std::vector<int> node;  ///< local → node of the mesh
    std::vector<Fan> fan;   ///< longest first
};

/// Cuts each material's tetrahedra into patches of nearly equal size by bisecting their centroids along the longest
/// side of their box, again and again. Deterministic. Throws InvalidInput unless tets ≥ 1 and 1 ≤ longest_fan ≤
/// most_of_a_fan.
std::vector<Patch> cut_into_patches(const RestState& rest, const PatchShape& shape);

/// Fans that cover the tetrahedra (4 × n local node numbers, positively oriented) once each, greedily the longest
/// first.
std::vector<Fan> fans_of(std::span<const std::array<int, 4>> tets, int longest);

}  // namespace tissuewarp::tled::detail
