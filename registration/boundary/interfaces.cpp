#include "registration/boundary/interfaces.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <set>
#include <tuple>

namespace tissuewarp::registration {

namespace {

using Corners = std::array<int, 3>;

/// Gives faces of an open mesh that lie on one another each the other's label as the outer one; returns which do.
std::vector<bool> join_sides(std::vector<meshing::InterfaceFace>& faces,
                             const std::vector<tled::SlidingPair>& sliding) {
    std::vector<bool> slides(faces.size(), false);
    if (sliding.empty()) return slides;
    std::map<int, int> place;
    for (const tled::SlidingPair& pair : sliding) place[pair.second] = pair.first;
    std::map<Corners, std::size_t> one_side;
    for (std::size_t f = 0; f < faces.size(); ++f) {
        if (faces[f].outer != 0) continue;
        Corners corners = faces[f].nodes;
        for (int& node : corners)
            for (auto at = place.find(node); at != place.end(); at = place.find(node)) node = at->second;
        std::sort(corners.begin(), corners.end());
        const auto [at, fresh] = one_side.try_emplace(corners, f);
        if (fresh) continue;
        faces[f].outer = faces[at->second].inner;
        faces[at->second].outer = faces[f].inner;
        slides[f] = slides[at->second] = true;
    }
    return slides;
}

}  // namespace

Interfaces::Interfaces(const meshing::TetMesh& mesh) : Interfaces(mesh, {}) {}

Interfaces::Interfaces(const meshing::TetMesh& mesh, const std::vector<tled::SlidingPair>& sliding) {
    std::vector<meshing::InterfaceFace> faces = meshing::interface_faces(mesh);
    const std::vector<bool> slides = join_sides(faces, sliding);
    std::map<std::tuple<int, int, int>, int> index;  // (inner, outer, node) → entry
    for (std::size_t f = 0; f < faces.size(); ++f) {
        const meshing::InterfaceFace& face = faces[f];
        std::array<int, 3> entries{};
        const Eigen::Vector3d a = mesh.nodes.col(face.nodes[0]), b = mesh.nodes.col(face.nodes[1]),
                              c = mesh.nodes.col(face.nodes[2]);
        const Eigen::Vector3d twice_area = (b - a).cross(c - a);
        for (std::size_t corner = 0; corner < 3; ++corner) {
            const auto [entry, fresh] =
                index.try_emplace({face.inner, face.outer, face.nodes[corner]}, static_cast<int>(nodes_.size()));
            if (fresh)
                nodes_.push_back({face.nodes[corner], face.inner, face.outer, 0.0, Eigen::Vector3d::Zero(), 0.0});
            entries[corner] = entry->second;
            InterfaceNode& node = nodes_[static_cast<std::size_t>(entry->second)];
            node.slides = node.slides || slides[f];
            node.area += twice_area.norm() / 6;
            node.normal += twice_area;
        }
        faces_.push_back(face.nodes);
        face_entries_.push_back(entries);
    }
    for (InterfaceNode& node : nodes_) node.normal.normalize();
}

std::vector<std::array<int, 3>> Interfaces::outer_faces() const {
    std::vector<std::array<int, 3>> faces;
    for (std::size_t f = 0; f < faces_.size(); ++f)
        if (nodes_[static_cast<std::size_t>(face_entries_[f][0])].outer == 0) faces.push_back(faces_[f]);
    return faces;
}

std::vector<std::array<int, 3>> Interfaces::faces_between(int inner, int outer) const {
    std::vector<std::array<int, 3>> faces;
    for (std::size_t f = 0; f < faces_.size(); ++f) {
        const InterfaceNode& node = nodes_[static_cast<std::size_t>(face_entries_[f][0])];
        if (node.inner == inner && node.outer == outer) faces.push_back(faces_[f]);
    }
    return faces;
}

Eigen::Matrix3Xd Interfaces::on_sliding_faces(const Eigen::Matrix3Xd& positions) const {
    constexpr double apart_mm = 1.5;
    std::vector<Eigen::Vector3d> points;
    for (std::size_t f = 0; f < faces_.size(); ++f) {
        const InterfaceNode& node = nodes_[static_cast<std::size_t>(face_entries_[f][0])];
        if (!node.slides || node.inner < node.outer) continue;  // the other side's faces lie in the same places
        const Eigen::Vector3d a = positions.col(faces_[f][0]), ab = positions.col(faces_[f][1]) - a,
                              ac = positions.col(faces_[f][2]) - a;
        const int steps = 1 + static_cast<int>(std::max(ab.norm(), ac.norm()) / apart_mm);
        for (int i = 0; i <= steps; ++i)
            for (int j = 0; i + j <= steps; ++j) points.emplace_back(a + (i * ab + j * ac) / steps);
    }
    Eigen::Matrix3Xd result(3, static_cast<Eigen::Index>(points.size()));
    for (std::size_t p = 0; p < points.size(); ++p) result.col(static_cast<Eigen::Index>(p)) = points[p];
    return result;
}

Eigen::Matrix3Xd Interfaces::normals(const Eigen::Matrix3Xd& positions) const {
    Eigen::Matrix3Xd normals = Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(nodes_.size()));
    for (std::size_t f = 0; f < faces_.size(); ++f) {
        const Eigen::Vector3d a = positions.col(faces_[f][0]), b = positions.col(faces_[f][1]),
                              c = positions.col(faces_[f][2]);
        const Eigen::Vector3d twice_area = (b - a).cross(c - a);
        for (const int entry : face_entries_[f]) normals.col(entry) += twice_area;
    }
    normals.colwise().normalize();
    return normals;
}

std::vector<std::vector<int>> Interfaces::neighbours() const {
    std::vector<std::set<int>> adjacent(nodes_.size());
    for (const std::array<int, 3>& entries : face_entries_)
        for (const int entry : entries)
            adjacent[static_cast<std::size_t>(entry)].insert(entries.begin(), entries.end());
    std::vector<std::vector<int>> result;
    for (std::size_t entry = 0; entry < adjacent.size(); ++entry) {
        std::set<int> near;
        for (const int next : adjacent[entry]) {
            const std::set<int>& beyond = adjacent[static_cast<std::size_t>(next)];
            near.insert(beyond.begin(), beyond.end());
        }
        near.erase(static_cast<int>(entry));
        result.emplace_back(near.begin(), near.end());
    }
    return result;
}

std::map<int, double> Interfaces::thickness(const meshing::TetMesh& mesh) const {
    std::map<int, double> volume, area;
    const Eigen::VectorXd volumes = meshing::tet_volumes(mesh);
    for (int t = 0; t < mesh.tet_count(); ++t) volume[mesh.labels[t]] += volumes[t];
    for (const InterfaceNode& node : nodes_) {
        area[node.inner] += node.area;
        if (!node.slides) area[node.outer] += node.area;
    }
    std::map<int, double> result;
    for (const auto& [label, of_label] : volume) result[label] = 2 * of_label / area.at(label);
    return result;
}

}  // namespace tissuewarp::registration
