#include "simulation/region.hpp"

#include "core/errors.hpp"

#include <Eigen/Geometry>

#include <algorithm>

namespace tissuewarp::simulation {

using Eigen::Matrix3Xi;
using Eigen::Vector3d;
using meshing::InterfaceFace;

namespace {

/// Whether the face lies on what the region calls its surface; on the outer one where it names none.
bool belongs(const Region& region, const InterfaceFace& face) {
    if (region.interface) {
        const auto [a, b] = *region.interface;
        return (face.inner == a && face.outer == b) || (face.inner == b && face.outer == a);
    }
    if (region.surface_of && *region.surface_of > 0)
        return face.inner == *region.surface_of || face.outer == *region.surface_of;
    return face.outer == 0;
}

/// The label on whose side the region's faces are.
int side_of(const Region& region, const InterfaceFace& face) {
    if (region.interface) return (*region.interface)[0];
    return region.surface_of.value_or(0) > 0 ? *region.surface_of : face.inner;
}

Matrix3Xi matrix_of(const std::vector<std::array<int, 3>>& faces) {
    Matrix3Xi matrix(3, static_cast<Eigen::Index>(faces.size()));
    for (std::size_t f = 0; f < faces.size(); ++f)
        matrix.col(static_cast<Eigen::Index>(f)) = Eigen::Map<const Eigen::Vector3i>(faces[f].data());
    return matrix;
}

/// The face seen by the tissue of a label: its nodes there, normal outward.
std::array<int, 3> seen_from(const tled::TissueMesh& tissue, const tled::TissueFace& each, int label) {
    const InterfaceFace& face = each.face;
    const int tet = face.inner == label ? each.inner_tet : each.outer_tet;
    const auto node = [&](std::size_t corner) { return tissue.node_of(face.nodes[corner], tet); };
    return face.inner == label ? std::array<int, 3>{node(0), node(1), node(2)}
                               : std::array<int, 3>{node(0), node(2), node(1)};
}

}  // namespace

RegionFinder::RegionFinder(const tled::TissueMesh& tissue, const Regions& regions)
    : tissue_(tissue),
      regions_(regions),
      lower_(tissue.mesh.nodes.rowwise().minCoeff()),
      upper_(tissue.mesh.nodes.rowwise().maxCoeff()) {}

const Region& RegionFinder::region(const std::string& name) const {
    const auto found = regions_.find(name);
    if (found == regions_.end()) throw InvalidInput("there is no set '" + name + "'");
    return found->second;
}

bool RegionFinder::contains(const Region& region, const Vector3d& point) const {
    if (region.box && ((point - region.box->lower).minCoeff() < 0 || (region.box->upper - point).minCoeff() < 0))
        return false;
    if (region.ball && (point - region.ball->centre).norm() > region.ball->radius) return false;
    if (region.half_space && (point - region.half_space->point).dot(region.half_space->normal) > 0) return false;
    if (!region.side) return true;
    const Side& side = *region.side;
    const double depth = side.depth_mm > 0 ? side.depth_mm : 1e-3 * (upper_ - lower_).norm();
    return side.upper ? point[side.axis] >= upper_[side.axis] - depth : point[side.axis] <= lower_[side.axis] + depth;
}

std::vector<bool> RegionFinder::holds_node(const std::string& name, int depth) const {
    const Region& region = this->region(name);
    if (depth > static_cast<int>(regions_.size())) throw InvalidInput("the set '" + name + "' is left out of itself");
    std::vector<bool> held(static_cast<std::size_t>(tissue_.mesh.node_count()), true);
    const auto keep_only = [&](const std::vector<bool>& others) {
        for (std::size_t n = 0; n < held.size(); ++n) held[n] = held[n] && others[n];
    };
    if (region.label) {
        std::vector<bool> of_label(held.size(), false);
        for (int e = 0; e < tissue_.mesh.tet_count(); ++e)
            if (tissue_.mesh.labels[e] == *region.label)
                for (const int node : tissue_.mesh.tets.col(e)) of_label[static_cast<std::size_t>(node)] = true;
        keep_only(of_label);
    }
    if (region.interface || region.surface_of) {
        std::vector<bool> of_surface(held.size(), false);
        const auto mark = [&](const tled::TissueFace& face, int label) {
            for (const int node : seen_from(tissue_, face, label)) of_surface[static_cast<std::size_t>(node)] = true;
        };
        for (const tled::TissueFace& each : tissue_.faces) {
            if (!belongs(region, each.face)) continue;
            mark(each, side_of(region, each.face));
            if (region.interface) mark(each, (*region.interface)[1]);
        }
        keep_only(of_surface);
    }
    for (std::size_t n = 0; n < held.size(); ++n)
        held[n] = held[n] && contains(region, tissue_.mesh.nodes.col(static_cast<Eigen::Index>(n)));
    for (const std::string& other : region.without) {
        std::vector<bool> left = holds_node(other, depth + 1);
        left.flip();
        keep_only(left);
    }
    return held;
}

std::vector<int> RegionFinder::nodes(const std::string& name) const {
    const std::vector<bool> held = holds_node(name, 0);
    std::vector<int> nodes;
    for (std::size_t n = 0; n < held.size(); ++n)
        if (held[n]) nodes.push_back(static_cast<int>(n));
    if (nodes.empty()) throw InvalidInput("the set '" + name + "' holds no node of the mesh; see where the mesh lies");
    return nodes;
}

Matrix3Xi RegionFinder::faces(const std::string& name) const {
    const Region& region = this->region(name);
    const std::vector<bool> held = holds_node(name, 0);
    std::vector<std::array<int, 3>> found;
    for (const tled::TissueFace& each : tissue_.faces) {
        if (!belongs(region, each.face)) continue;
        const std::array<int, 3> nodes = seen_from(tissue_, each, side_of(region, each.face));
        if (std::all_of(nodes.begin(), nodes.end(), [&](int node) { return held[static_cast<std::size_t>(node)]; }))
            found.push_back(nodes);
    }
    if (found.empty()) throw InvalidInput("the set '" + name + "' holds no face of a surface; see where the mesh lies");
    return matrix_of(found);
}

Matrix3Xi RegionFinder::outer_faces() const {
    std::vector<std::array<int, 3>> found;
    for (const tled::TissueFace& each : tissue_.faces)
        if (each.face.outer == 0) found.push_back(seen_from(tissue_, each, each.face.inner));
    return matrix_of(found);
}

std::vector<int> RegionFinder::tets(const std::string& name) const {
    const auto holds = [&](const auto& self, const std::string& which, int tet, const Vector3d& centroid,
                           int depth) -> bool {
        const Region& region = this->region(which);
        if (depth > static_cast<int>(regions_.size()))
            throw InvalidInput("the set '" + which + "' is left out of itself");
        if (region.interface || region.surface_of)
            throw InvalidInput("the set '" + which + "' is a surface; give one of tissue, by label, box or ball");
        if (region.label && tissue_.mesh.labels[tet] != *region.label) return false;
        if (!contains(region, centroid)) return false;
        return std::none_of(region.without.begin(), region.without.end(),
                            [&](const std::string& other) { return self(self, other, tet, centroid, depth + 1); });
    };
    std::vector<int> found;
    for (int e = 0; e < tissue_.mesh.tet_count(); ++e) {
        const Vector3d centroid = tissue_.mesh.nodes(Eigen::all, tissue_.mesh.tets.col(e)).rowwise().mean();
        if (holds(holds, name, e, centroid, 0)) found.push_back(e);
    }
    if (found.empty()) throw InvalidInput("the set '" + name + "' holds no tetrahedron; see where the mesh lies");
    return found;
}

Eigen::VectorXd nodal_areas(const meshing::TetMesh& mesh, const Matrix3Xi& faces) {
    Eigen::VectorXd area = Eigen::VectorXd::Zero(mesh.node_count());
    for (Eigen::Index f = 0; f < faces.cols(); ++f) {
        const Vector3d a = mesh.nodes.col(faces(0, f)), b = mesh.nodes.col(faces(1, f)),
                       c = mesh.nodes.col(faces(2, f));
        for (const int node : faces.col(f)) area[node] += (b - a).cross(c - a).norm() / 6;
    }
    return area;
}

}  // namespace tissuewarp::simulation
