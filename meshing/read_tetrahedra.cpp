// Tetrahedra of other programs: by extension, then the checks that all formats share.

#include "core/file_message.hpp"
#include "meshing/detail/tetrahedra_formats.hpp"
#include "meshing/quality.hpp"

#include <algorithm>

namespace tissuewarp::meshing {

namespace {

using detail::FileReader;
using detail::RawTetrahedra;

/// Smallest dihedral angle below which an element makes steps short and stiffness badly conditioned.
constexpr double flat_deg = 5;

TetMesh mesh_of(const RawTetrahedra& raw, const FileReader& file) {
    TetMesh mesh;
    mesh.nodes.resize(3, static_cast<Eigen::Index>(raw.nodes.size()));
    for (std::size_t n = 0; n < raw.nodes.size(); ++n) mesh.nodes.col(static_cast<Eigen::Index>(n)) = raw.nodes[n];
    mesh.tets.resize(4, static_cast<Eigen::Index>(raw.tets.size()));
    for (std::size_t t = 0; t < raw.tets.size(); ++t)
        for (std::size_t k = 0; k < 4; ++k) {
            const auto node = raw.node_of.find(raw.tets[t][k]);
            if (node == raw.node_of.end())
                file.refuse("uses node " + std::to_string(raw.tets[t][k]) + ", which it does not give");
            mesh.tets(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(t)) = node->second;
        }
    mesh.labels = Eigen::Map<const Eigen::VectorXi>(raw.labels.data(), static_cast<Eigen::Index>(raw.labels.size()));
    return mesh;
}

/// Files of other programs may follow the other orientation throughout; a mixture is folded tissue.
void orient(MeshFile& read, const FileReader& file) {
    const auto inverted = (tet_volumes(read.mesh).array() < 0).count();
    if (inverted == 0) return;
    if (inverted < read.mesh.tet_count())
        file.refuse("has " + std::to_string(inverted) + " inverted elements of " +
                    std::to_string(read.mesh.tet_count()) + "; make it anew without");
    read.mesh.tets.row(2).swap(read.mesh.tets.row(3));
    read.notes.emplace_back("all its tetrahedra were inverted; they were turned");
}

/// Free nodes have no stiffness.
void drop_unused_nodes(MeshFile& read) {
    std::vector<int> number(static_cast<std::size_t>(read.mesh.node_count()), -1);
    for (const int node : read.mesh.tets.reshaped()) number[static_cast<std::size_t>(node)] = 0;
    Eigen::Index count = 0;
    for (std::size_t n = 0; n < number.size(); ++n) {
        if (number[n] < 0) continue;
        read.mesh.nodes.col(count) = read.mesh.nodes.col(static_cast<Eigen::Index>(n));
        number[n] = static_cast<int>(count++);
    }
    if (count == read.mesh.nodes.cols()) return;
    read.notes.push_back(std::to_string(read.mesh.nodes.cols() - count) +
                         " nodes that no tetrahedron uses were left "
                         "out");
    read.mesh.nodes.conservativeResize(3, count);
    for (int& node : read.mesh.tets.reshaped()) node = number[static_cast<std::size_t>(node)];
}

void note_quality(MeshFile& read) {
    const auto flat = (dihedral_angles(read.mesh).row(0).array() < flat_deg).count();
    if (flat > 0)
        read.notes.push_back(std::to_string(flat) + " of its " + std::to_string(read.mesh.tet_count()) +
                             " tetrahedra have dihedral angles below 5 degrees: equilibria take longer, or fail");
    const int pieces = quality(read.mesh).components;
    if (pieces > 1)
        read.notes.push_back("it is in " + std::to_string(pieces) +
                             " pieces that share no face; where they should, merge their nodes");
}

MeshFile read_checked(const std::filesystem::path& path) {
    MeshFile read;
    const std::string extension = detail::extension_of(path);
    FileReader file(path);
    if (extension == ".vtu") {
        read = detail::read_vtu_with_notes(path);
    } else if (extension == ".msh" || extension == ".inp") {
        RawTetrahedra raw = extension == ".msh" ? detail::read_msh(file) : detail::read_inp(file);
        read.mesh = mesh_of(raw, file);
        std::erase_if(raw.label_names, [&](const auto& entry) {
            return std::find(raw.labels.begin(), raw.labels.end(), entry.first) == raw.labels.end();
        });
        read.label_names = std::move(raw.label_names);
        read.notes = std::move(raw.notes);
    } else {
        file.fail("has the extension '" + extension + "'; tetrahedra are read from .vtu, .msh and .inp");
    }
    if (read.mesh.tet_count() == 0) file.refuse("has no linear tetrahedra; give a mesh of these");
    drop_unused_nodes(read);
    orient(read, file);
    require_valid(read.mesh, path.string().c_str());
    note_quality(read);
    return read;
}

}  // namespace

MeshFile read_tetrahedra(const std::filesystem::path& path) {
    return naming(path, [&] { return read_checked(path); });
}

}  // namespace tissuewarp::meshing
