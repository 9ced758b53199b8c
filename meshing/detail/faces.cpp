#include "meshing/detail/faces.hpp"

#include "core/errors.hpp"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <string>

namespace tissuewarp::meshing::detail {

std::vector<TetFace> sorted_faces(const TetMesh& mesh) {
    std::vector<TetFace> faces(4 * static_cast<std::size_t>(mesh.tet_count()));
    for (int t = 0; t < mesh.tet_count(); ++t) {
        for (int corner = 0; corner < 4; ++corner) {
            TetFace& face = faces[4 * static_cast<std::size_t>(t) + static_cast<std::size_t>(corner)];
            for (int k = 0; k < 3; ++k) face.nodes[k] = mesh.tets(face_corners[corner][k], t);
            std::sort(face.nodes.begin(), face.nodes.end());
            face.tet = t;
            face.corner = corner;
        }
    }
    tbb::parallel_sort(faces.begin(), faces.end());
    return faces;
}

void throw_shared_face(const TetFace& face) {
    throw InvalidInput("the face of nodes " + std::to_string(face.nodes[0]) + ", " + std::to_string(face.nodes[1]) +
                       ", " + std::to_string(face.nodes[2]) +
                       " belongs to three or more tetrahedra; at most two may share a face: remove duplicates");
}

std::vector<std::array<int, 2>> unique_edges(const TetMesh& mesh) {
    std::vector<std::array<int, 2>> edges;
    edges.reserve(6 * static_cast<std::size_t>(mesh.tet_count()));
    for (int t = 0; t < mesh.tet_count(); ++t) {
        for (const auto& [a, b] : edge_corners)
            edges.push_back({std::min(mesh.tets(a, t), mesh.tets(b, t)), std::max(mesh.tets(a, t), mesh.tets(b, t))});
    }
    tbb::parallel_sort(edges.begin(), edges.end());
    edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
    return edges;
}

}  // namespace tissuewarp::meshing::detail
