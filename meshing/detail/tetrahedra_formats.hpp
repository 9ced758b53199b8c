#pragma once
/// One reader per format of tetrahedra; the checks common to all stand in read_tetrahedra.

#include "meshing/detail/file_reader.hpp"
#include "meshing/mesh_io.hpp"

#include <array>
#include <map>
#include <string>
#include <unordered_map>
#include <vector>

namespace tissuewarp::meshing::detail {

/// What a reader collects: nodes by the numbers of the file, and elements that name these.
struct RawTetrahedra {
    std::vector<Eigen::Vector3d> nodes;
    std::unordered_map<long long, int> node_of;  ///< number in the file → index
    std::vector<std::array<long long, 4>> tets;
    std::vector<int> labels;
    std::map<int, std::string> label_names;
    std::vector<std::string> notes;

    void add_node(long long number, const Eigen::Vector3d& place, const FileReader& file) {
        if (!node_of.emplace(number, static_cast<int>(nodes.size())).second)
            file.refuse("gives node " + std::to_string(number) + " twice; write one mesh of one part");
        nodes.push_back(place);
    }
};

RawTetrahedra read_msh(FileReader& file);  ///< Gmsh
RawTetrahedra read_inp(FileReader& file);  ///< Abaqus

/// As read_vtu, with its notes.
MeshFile read_vtu_with_notes(const std::filesystem::path& path);

}  // namespace tissuewarp::meshing::detail
