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

std::string document(const TetMesh& mesh, const std::vector<MeshArray>& points, const std::vector<MeshArray>& cells) {
    constexpr std::uint8_t vtk_tetra = 10;
    const auto count = static_cast<std::size_t>(mesh.tet_count());
    std::vector<std::int64_t> offsets(count);
    for (std::size_t t = 0; t < count; ++t) offsets[t] = 4 * static_cast<std::int64_t>(t + 1);

    VtkAppended data;
    std::string xml =
        "<?xml version=\"1.0\"?>\n"
        "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n"
        "<UnstructuredGrid>\n<Piece NumberOfPoints=\"" +
        std::to_string(mesh.node_count()) + "\" NumberOfCells=\"" + std::to_string(count) + "\">\n<PointData>\n";
    xml += detail::float_arrays(data, points, mesh.nodes.cols(), "nodes");
    xml += "</PointData>\n<CellData>\n";
    xml += data.array("Int32", "label", 1, std::vector<std::int32_t>(mesh.labels.begin(), mesh.labels.end()));
    xml += detail::float_arrays(data, cells, mesh.tets.cols(), "cells");
    xml += "</CellData>\n<Points>\n";
    xml += data.array("Float64", "Points", 3,
                      std::vector<double>(mesh.nodes.data(), mesh.nodes.data() + mesh.nodes.size()));
    xml += "</Points>\n<Cells>\n";
    xml += data.array("Int64", "connectivity", 1,
                      std::vector<std::int64_t>(mesh.tets.data(), mesh.tets.data() + mesh.tets.size()));
    xml += data.array("Int64", "offsets", 1, offsets);
    xml += data.array("UInt8", "types", 1, std::vector<std::uint8_t>(count, vtk_tetra));
    xml += "</Cells>\n</Piece>\n</UnstructuredGrid>\n<AppendedData encoding=\"raw\">\n_";
    return xml + data.bytes() + "\n</AppendedData>\n</VTKFile>\n";
}

}  // namespace

void write_vtu(const TetMesh& mesh, const std::filesystem::path& path, const std::vector<MeshArray>& point_arrays,
               const std::vector<MeshArray>& cell_arrays) {
    if (mesh.labels.size() != mesh.tets.cols())
        throw InvalidInput("write_vtu: " + std::to_string(mesh.labels.size()) + " labels for " +
                           std::to_string(mesh.tet_count()) + " tetrahedra; give one label each");
    write_file(document(mesh, point_arrays, cell_arrays), path);
}

}  // namespace tissuewarp::meshing
