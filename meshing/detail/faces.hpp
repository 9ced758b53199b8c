#pragma once
/// Faces and edges of a tetrahedral mesh as sorted arrays: the shared first step of boundaries, interfaces, components.

#include "meshing/tet_mesh.hpp"

#include <array>
#include <cstdint>
#include <vector>

namespace tissuewarp::meshing::detail {

/// Corners of the face opposite to corner k, the right-hand normal pointing out of a positively oriented tetrahedron.
inline constexpr std::array<std::array<int, 3>, 4> face_corners{{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};

/// Corners of the six edges.
inline constexpr std::array<std::array<int, 2>, 6> edge_corners{{{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}}};

struct TetFace {
    std::array<int, 3> nodes;  ///< ascending
    int tet = -1;
    int corner = -1;  ///< the corner opposite to the face

    auto operator<=>(const TetFace&) const = default;
};

/// The 4 M faces sorted by nodes, then by tetrahedron, so that the two sides of an inner face are neighbours.
std::vector<TetFace> sorted_faces(const TetMesh& mesh);

/// Calls `visit(first, second)` for every face once; `second` is null on the outer boundary. Throws InvalidInput where
/// three or more tetrahedra share a face.
template <class Visit>
void for_each_face(const std::vector<TetFace>& faces, const Visit& visit);

[[noreturn]] void throw_shared_face(const TetFace& face);

/// Every edge once, nodes ascending, sorted.
std::vector<std::array<int, 2>> unique_edges(const TetMesh& mesh);

template <class Visit>
void for_each_face(const std::vector<TetFace>& faces, const Visit& visit) {
    for (std::size_t i = 0; i < faces.size();) {
        std::size_t end = i + 1;
        while (end < faces.size() && faces[end].nodes == faces[i].nodes) ++end;
        if (end - i > 2) throw_shared_face(faces[i]);
        visit(faces[i], end - i == 2 ? &faces[i + 1] : nullptr);
        i = end;
    }
}

}  // namespace tissuewarp::meshing::detail
