#include "tled/error/bubble_conditions.hpp"

#include "core/errors.hpp"
#include "tled/model/springs.hpp"

#include <Eigen/Geometry>

#include <array>
#include <string>

namespace tissuewarp::tled::detail {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

using Face = std::array<int, 3>;

double area_of(const meshing::TetMesh& mesh, const Face& face) {
    const Vector3d a = mesh.nodes.col(face[0]);
    return 0.5 * Vector3d(mesh.nodes.col(face[1]) - a).cross(Vector3d(mesh.nodes.col(face[2]) - a)).norm();
}

/// Calls visit(edge, corner a, corner b, opposite corner) for the edges of a face, corners by their place in it.
template <class Visit>
void for_each_edge(const HierarchicalSpace& space, const Face& face, const Visit& visit) {
    for (std::size_t a = 0; a < 3; ++a) {
        const std::size_t b = (a + 1) % 3, opposite = (a + 2) % 3;
        visit(space.edge_between(face[a], face[b]), a, b, opposite);
    }
}

void require_face(const HierarchicalSpace& space, const Face& face) {
    bool is_face = true;
    for_each_edge(space, face, [&](int edge, auto, auto, auto) { is_face = is_face && edge >= 0; });
    if (is_face) return;
    throw InvalidInput("a traction acts on the corners " + std::to_string(face[0]) + ", " + std::to_string(face[1]) +
                       ", " + std::to_string(face[2]) + ", which are no face of the mesh; give those of one");
}

// ∫ 4 L_a L_b over a tetrahedron is V/5, over a triangle A/3.
void add_loads(const HierarchicalSpace& space, const VectorXd& volume, const meshing::TetMesh& mesh,
               const DistributedLoads& loads, BubbleConditions& result) {
    if (!loads.body_force.isZero(0.0)) {
        for (Eigen::Index e = 0; e < volume.size(); ++e) {
            for (const int edge : space.edge_of.col(e)) result.force.col(edge) += 0.2 * volume[e] * loads.body_force;
        }
    }
    for (const FaceTraction& each : loads.tractions) {
        require_face(space, each.corners);
        const Vector3d share = area_of(mesh, each.corners) / 3.0 * each.traction;
        for_each_edge(space, each.corners, [&](int edge, auto, auto, auto) { result.force.col(edge) += share; });
    }
}

/// Springs at nodes per area of the faces that they hold.
struct SpreadSprings {
    std::vector<int> of_node;  // entry of the conditions, or −1
    std::vector<double> area;  // of every node, mm²: a third of the faces with springs at all corners
    std::vector<Face> faces;
};

SpreadSprings spread(const meshing::TetMesh& mesh, const NodalConditions& conditions,
                     const std::vector<meshing::InterfaceFace>& faces) {
    SpreadSprings result;
    result.of_node.assign(static_cast<std::size_t>(mesh.node_count()), -1);
    result.area.assign(static_cast<std::size_t>(mesh.node_count()), 0.0);
    for (std::size_t s = 0; s < conditions.spring_node.size(); ++s) {
        result.of_node[conditions.spring_node[s]] = static_cast<int>(s);
    }
    for (const meshing::InterfaceFace& face : faces) {
        const auto held = [&](int node) { return result.of_node[node] >= 0; };
        if (!held(face.nodes[0]) || !held(face.nodes[1]) || !held(face.nodes[2])) continue;
        result.faces.push_back(face.nodes);
        for (const int node : face.nodes) result.area[node] += area_of(mesh, face.nodes) / 3.0;
    }
    return result;
}

// Over a triangle ∫ L_a² L_b = A/30, ∫ L_a L_b L_c = A/60, ∫ L_a³ L_b² = A/210, ∫ L_a² L_b² L_c = A/630.
void add_springs(const HierarchicalSpace& space, const meshing::TetMesh& mesh, const NodalConditions& conditions,
                 const Matrix3Xd& displacement, const SpreadSprings& springs, BubbleConditions& result) {
    for (const Face& face : springs.faces) {
        std::array<Matrix3d, 3> stiffness;  // per area, mN/mm³
        std::array<Vector3d, 3> force;      // per area, kPa
        for (std::size_t c = 0; c < 3; ++c) {
            const int s = springs.of_node[face[c]];
            stiffness[c] = spring_matrix(conditions, s) / springs.area[face[c]];
            force[c] =
                conditions.spring_force.col(s) / springs.area[face[c]] - stiffness[c] * displacement.col(face[c]);
        }
        const double area = area_of(mesh, face);
        for_each_edge(space, face, [&](int edge, std::size_t a, std::size_t b, std::size_t c) {
            result.force.col(edge) += 4.0 * area * ((force[a] + force[b]) / 30.0 + force[c] / 60.0);
            result.stiffness.emplace_back(edge,
                                          16.0 * area * ((stiffness[a] + stiffness[b]) / 210.0 + stiffness[c] / 630.0));
        });
    }
}

}  // namespace

BubbleConditions bubble_conditions(const HierarchicalSpace& space, const VectorXd& volume, const meshing::TetMesh& mesh,
                                   const NodalConditions& conditions, const Matrix3Xd& displacement,
                                   const DistributedLoads& loads) {
    BubbleConditions result;
    result.constrained.setConstant(3, space.edge_count(), false);
    result.force = Matrix3Xd::Zero(3, space.edge_count());
    const std::vector<meshing::InterfaceFace> faces = meshing::interface_faces(mesh);
    for (const meshing::InterfaceFace& face : faces) {
        const auto held = conditions.constrained.col(face.nodes[0]).array() &&
                          conditions.constrained.col(face.nodes[1]).array() &&
                          conditions.constrained.col(face.nodes[2]).array();
        for_each_edge(space, face.nodes, [&](int edge, auto, auto, auto) {
            result.constrained.col(edge) = (result.constrained.col(edge).array() || held).eval();
        });
    }
    add_loads(space, volume, mesh, loads, result);
    add_springs(space, mesh, conditions, displacement, spread(mesh, conditions, faces), result);
    return result;
}

}  // namespace tissuewarp::tled::detail
