// VTK's XML unstructured grids of tetrahedra.

#include "meshing/detail/vtk_xml.hpp"
#include "meshing/mesh_io.hpp"

#include <algorithm>
#include <cmath>

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

/// Offsets must agree with the types.
void require_tetrahedra(const VtkXml& xml, std::size_t cells, const FileReader& file) {
    for (const double type : xml.values("Cells/types", cells))
        if (type != 10.0)
            file.refuse("has a cell of VTK type " + std::to_string(static_cast<int>(type)) +
                        "; only linear tetrahedra (10) are read: export a mesh of these alone");
    double end = 0.0;
    for (const double offset : xml.values("Cells/offsets", cells))
        if (offset != (end += 4.0)) file.refuse("has cell offsets that do not count the corners of its cells");
}

}  // namespace

TetMesh read_vtu(const std::filesystem::path& path) {
    FileReader file(path);
    const VtkXml xml(file, data_type);
    const std::size_t point_count = xml.count("NumberOfPoints"), cell_count = xml.count("NumberOfCells");
    require_tetrahedra(xml, cell_count, file);
    const std::vector<double> points = xml.values("Points/", 3 * point_count),
                              nodes = xml.values("Cells/connectivity", 4 * cell_count);
    TetMesh mesh;
    mesh.nodes = Eigen::Map<const Eigen::Matrix3Xd>(points.data(), 3, static_cast<Eigen::Index>(point_count));
    mesh.tets.resize(4, static_cast<Eigen::Index>(cell_count));
    mesh.labels = Eigen::VectorXi::Ones(mesh.tets.cols());
    std::transform(nodes.begin(), nodes.end(), mesh.tets.data(),
                   [&](double node) { return checked_integer(node, 0, mesh.node_count() - 1, "node index", file); });
    if (xml.has("CellData/label")) {
        const std::vector<double> labels = xml.values("CellData/label", cell_count);
        std::transform(labels.begin(), labels.end(), mesh.labels.data(),
                       [&](double label) { return checked_integer(label, 1, 2147483647, "label", file); });
    }
    orient(mesh);
    require_valid(mesh, path.string().c_str());
    return mesh;
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

}  // namespace tissuewarp::meshing
