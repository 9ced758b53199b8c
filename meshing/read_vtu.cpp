// VTK's XML unstructured grids of tetrahedra and hexahedra.

#include "meshing/detail/vtk_xml.hpp"
#include "meshing/mesh_io.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>

namespace tissuewarp::meshing {

namespace {

using detail::FileReader;
using detail::VtkXml;

constexpr const char* data_type = "UnstructuredGrid";

/// Files of other programs may follow the other orientation throughout; a mixture is damage and stays one.
void orient(TetMesh& mesh) {
    if (mesh.tet_count() > 0 && (tet_volumes(mesh).array() < 0.0).all()) mesh.tets.row(2).swap(mesh.tets.row(3));
}

int checked_integer(double value, int lowest, int highest, const char* what, const FileReader& file) {
    if (!(value >= lowest && value <= highest) || value != std::floor(value))
        file.refuse(std::string("has a ") + what + " of " + std::to_string(value) + "; it must be an integer from " +
                    std::to_string(lowest) + " to " + std::to_string(highest));
    return static_cast<int>(value);
}

enum class Accepted { Tetrahedra, TetrahedraAndHexahedra };

/// Corners of each cell by its VTK type, and in sum the size of the connectivity. Offsets must agree with them.
std::vector<int> cell_corners(const VtkXml& xml, std::size_t cells, Accepted accepted, const FileReader& file) {
    std::vector<int> corners;
    const std::vector<double> offsets = xml.values("Cells/offsets", cells);
    double end = 0.0;
    for (const double type : xml.values("Cells/types", cells)) {
        const bool hexahedron = type == 12.0 && accepted == Accepted::TetrahedraAndHexahedra;
        if (type != 10.0 && !hexahedron)
            file.refuse("has a cell of VTK type " + std::to_string(static_cast<int>(type)) +
                        (accepted == Accepted::Tetrahedra
                             ? "; only linear tetrahedra (10) are read"
                             : "; only linear tetrahedra (10) and hexahedra (12) are read"));
        end += hexahedron ? 8.0 : 4.0;
        if (offsets[corners.size()] != end) file.refuse("has cell offsets that do not count the corners of its cells");
        corners.push_back(hexahedron ? 8 : 4);
    }
    return corners;
}

MixedMesh read_cells(const std::filesystem::path& path, Accepted accepted) {
    FileReader file(path);
    const VtkXml xml(file, data_type);
    const std::size_t point_count = xml.count("NumberOfPoints"), cell_count = xml.count("NumberOfCells");
    const std::vector<int> corners = cell_corners(xml, cell_count, accepted, file);
    const auto total = static_cast<std::size_t>(std::accumulate(corners.begin(), corners.end(), std::int64_t{0}));
    const auto hex_count = std::count(corners.begin(), corners.end(), 8);
    const std::vector<double> points = xml.values("Points/", 3 * point_count),
                              nodes = xml.values("Cells/connectivity", total);
    std::vector<double> labels;
    if (xml.has("CellData/label")) labels = xml.values("CellData/label", cell_count);

    MixedMesh result;
    TetMesh& mesh = result.mesh;
    HexCells& hexahedra = result.hexahedra;
    mesh.nodes = Eigen::Map<const Eigen::Matrix3Xd>(points.data(), 3, static_cast<Eigen::Index>(point_count));
    mesh.tets.resize(4, static_cast<Eigen::Index>(corners.size()) - hex_count);
    mesh.labels = Eigen::VectorXi::Ones(mesh.tets.cols());
    hexahedra.hexes.resize(8, hex_count);
    hexahedra.labels = Eigen::VectorXi::Ones(hex_count);
    int *tet = mesh.tets.data(), *hex = hexahedra.hexes.data(), *tet_label = mesh.labels.data(),
        *hex_label = hexahedra.labels.data();
    auto node = nodes.begin();
    for (std::size_t cell = 0; cell < corners.size(); ++cell) {
        int*& corner = corners[cell] == 8 ? hex : tet;
        for (int k = 0; k < corners[cell]; ++k)
            *corner++ = checked_integer(*node++, 0, mesh.node_count() - 1, "node index", file);
        int*& label = corners[cell] == 8 ? hex_label : tet_label;
        if (!labels.empty()) *label++ = checked_integer(labels[cell], 1, 2147483647, "label", file);
    }
    orient(mesh);
    const std::string name = path.string();
    if (hex_count > 0) require_valid(mesh.nodes, hexahedra, name.c_str());
    if (mesh.tet_count() > 0 || hex_count == 0) require_valid(mesh, name.c_str());
    return result;
}

}  // namespace

TetMesh read_vtu(const std::filesystem::path& path) {
    return read_cells(path, Accepted::Tetrahedra).mesh;
}

Eigen::MatrixXd read_vtu_cell_array(const std::filesystem::path& path, const std::string& name) {
    const std::string section = "CellData/", key = section + name;
    FileReader file(path);
    const VtkXml xml(file, data_type);
    if (!xml.has(key)) {
        std::string names;
        for (const std::string& other : xml.names())
            if (other.starts_with(section)) names += (names.empty() ? "'" : ", '") + other.substr(section.size()) + "'";
        file.refuse("has no cell array '" + name + "'" + (names.empty() ? "" : "; it has " + names));
    }
    const std::vector<double> values = xml.values(key);
    const auto cells = static_cast<Eigen::Index>(xml.count("NumberOfCells"));
    if (cells == 0 || values.empty() || values.size() % static_cast<std::size_t>(cells) != 0)
        file.refuse("has " + std::to_string(values.size()) + " values in the cell array '" + name + "' of " +
                    std::to_string(cells) + " cells");
    return Eigen::Map<const Eigen::MatrixXd>(values.data(), static_cast<Eigen::Index>(values.size()) / cells, cells);
}

MixedMesh read_mixed_vtu(const std::filesystem::path& path) {
    return read_cells(path, Accepted::TetrahedraAndHexahedra);
}

}  // namespace tissuewarp::meshing
