// VTK XML unstructured grid with raw appended data:
// https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html

#include "core/atomic_file.hpp"
#include "core/errors.hpp"
#include "meshing/detail/vtk_appended.hpp"
#include "meshing/mesh_io.hpp"

#include <cstdint>

namespace tissuewarp::meshing {

namespace {

using detail::VtkAppended;

std::string arrays(VtkAppended& data, const std::vector<MeshArray>& list, Eigen::Index count, const char* what) {
    std::string elements;
    for (const MeshArray& array : list) {
        if (array.values.cols() != count || array.values.rows() == 0)
            throw InvalidInput("write_vtu: array '" + array.name + "' has " + std::to_string(array.values.cols()) +
                               " columns for " + std::to_string(count) + " " + what + "; give one column each");
        const Eigen::MatrixXf values = array.values.cast<float>();
        elements += data.array("Float32", array.name, values.rows(),
                               std::vector<float>(values.data(), values.data() + values.size()));
    }
    return elements;
}

/// Types, offsets, nodes and labels of all cells, tetrahedra before hexahedra.
struct Cells {
    std::vector<std::uint8_t> types;
    std::vector<std::int64_t> offsets, connectivity;
    std::vector<std::int32_t> labels;

    template <class Corners>
    void add(std::uint8_t vtk_type, const Corners& corners, const Eigen::VectorXi& label) {
        types.insert(types.end(), static_cast<std::size_t>(corners.cols()), vtk_type);
        connectivity.insert(connectivity.end(), corners.data(), corners.data() + corners.size());
        labels.insert(labels.end(), label.begin(), label.end());
        const std::int64_t first = offsets.empty() ? 0 : offsets.back();
        for (Eigen::Index cell = 1; cell <= corners.cols(); ++cell) offsets.push_back(first + corners.rows() * cell);
    }
};

std::string document(const TetMesh& mesh, const HexCells& hexahedra, const std::vector<MeshArray>& points,
                     const std::vector<MeshArray>& cell_arrays) {
    constexpr std::uint8_t vtk_tetra = 10, vtk_hexahedron = 12;
    Cells cells;
    cells.add(vtk_tetra, mesh.tets, mesh.labels);
    cells.add(vtk_hexahedron, hexahedra.hexes, hexahedra.labels);
    const std::size_t count = cells.types.size();

    VtkAppended data;
    std::string xml =
        "<?xml version=\"1.0\"?>\n"
        "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n"
        "<UnstructuredGrid>\n<Piece NumberOfPoints=\"" +
        std::to_string(mesh.node_count()) + "\" NumberOfCells=\"" + std::to_string(count) + "\">\n<PointData>\n";
    xml += arrays(data, points, mesh.nodes.cols(), "nodes");
    xml += "</PointData>\n<CellData>\n";
    xml += data.array("Int32", "label", 1, cells.labels);
    xml += arrays(data, cell_arrays, static_cast<Eigen::Index>(count), "cells");
    xml += "</CellData>\n<Points>\n";
    xml += data.array("Float64", "Points", 3,
                      std::vector<double>(mesh.nodes.data(), mesh.nodes.data() + mesh.nodes.size()));
    xml += "</Points>\n<Cells>\n";
    xml += data.array("Int64", "connectivity", 1, cells.connectivity);
    xml += data.array("Int64", "offsets", 1, cells.offsets);
    xml += data.array("UInt8", "types", 1, cells.types);
    xml += "</Cells>\n</Piece>\n</UnstructuredGrid>\n<AppendedData encoding=\"raw\">\n_";
    return xml + data.bytes() + "\n</AppendedData>\n</VTKFile>\n";
}

void write(const TetMesh& mesh, const HexCells& hexahedra, const std::filesystem::path& path,
           const std::vector<MeshArray>& point_arrays, const std::vector<MeshArray>& cell_arrays) {
    if (mesh.labels.size() != mesh.tets.cols() || hexahedra.labels.size() != hexahedra.hexes.cols())
        throw InvalidInput("write_vtu: " + std::to_string(mesh.labels.size()) + " labels for " +
                           std::to_string(mesh.tet_count()) + " tetrahedra and " +
                           std::to_string(hexahedra.labels.size()) + " for " + std::to_string(hexahedra.count()) +
                           " hexahedra; give one label each");
    write_file(document(mesh, hexahedra, point_arrays, cell_arrays), path);
}

}  // namespace

void write_vtu(const TetMesh& mesh, const std::filesystem::path& path, const std::vector<MeshArray>& point_arrays,
               const std::vector<MeshArray>& cell_arrays) {
    write(mesh, {}, path, point_arrays, cell_arrays);
}

void write_vtu(const MixedMesh& mesh, const std::filesystem::path& path, const std::vector<MeshArray>& point_arrays,
               const std::vector<MeshArray>& cell_arrays) {
    write(mesh.mesh, mesh.hexahedra, path, point_arrays, cell_arrays);
}

}  // namespace tissuewarp::meshing
