// VTK's XML unstructured grids of tetrahedra.

#include "core/text_table.hpp"
#include "meshing/detail/tetrahedra_formats.hpp"
#include "meshing/detail/vtk_xml.hpp"
#include "meshing/mesh_io.hpp"

#include <algorithm>
#include <cmath>
#include <set>

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

constexpr const char* cell_data = "CellData/";

/// Of those that the file has, without the section.
std::vector<std::string> cell_arrays(const VtkXml& xml) {
    std::vector<std::string> names;
    for (const std::string& name : xml.names())
        if (name.starts_with(cell_data)) names.push_back(name.substr(std::string(cell_data).size()));
    return names;
}

std::string quoted_list(const std::vector<std::string>& names) {
    std::string text;
    for (const std::string& name : names) text += (text.empty() ? "'" : ", '") + name + "'";
    return text;
}

/// `label`, in any case where there is none so written, else what meshio makes of Gmsh's groups; empty where the file
/// has neither.
std::string label_array(const VtkXml& xml, const FileReader& file) {
    std::vector<std::string> labels, groups;
    for (const std::string& name : cell_arrays(xml)) {
        if (name == "label") return name;
        if (lower_case(name) == "label") labels.push_back(name);
        if (lower_case(name) == "gmsh:physical") groups.push_back(name);
    }
    const std::vector<std::string>& found = labels.empty() ? groups : labels;
    if (found.size() > 1)
        file.refuse("has the cell arrays " + quoted_list(found) + "; name the one that holds labels 'label'");
    return found.empty() ? "" : found.front();
}

/// True for several whole numbers from 0 on that repeat, as labels do and numbers of elements do not.
bool may_be_labels(const std::vector<double>& values, std::size_t cells) {
    if (values.size() != cells) return false;
    if (!std::all_of(values.begin(), values.end(), [](double v) { return v >= 0 && v == std::floor(v); })) return false;
    const std::size_t distinct = std::set<double>(values.begin(), values.end()).size();
    return distinct > 1 && distinct < cells;
}

/// Label 1 for all, and a note where the file has arrays that may have been meant.
void take_no_labels(const VtkXml& xml, MeshFile& read) {
    read.mesh.labels.setOnes();
    const auto cells = static_cast<std::size_t>(read.mesh.labels.size());
    std::vector<std::string> candidates;
    for (const std::string& name : cell_arrays(xml))
        if (xml.is_numeric(cell_data + name) && may_be_labels(xml.values(cell_data + name), cells))
            candidates.push_back(name);
    if (!candidates.empty())
        read.notes.push_back("it has no cell array 'label', and all its tetrahedra have label 1; where " +
                             quoted_list(candidates) + " holds labels, name it 'label'");
}

void read_labels(const VtkXml& xml, const FileReader& file, MeshFile& read) {
    const std::string name = label_array(xml, file);
    if (name.empty()) return take_no_labels(xml, read);
    const std::string what = "label in the cell array '" + name + "'";
    const auto cells = static_cast<std::size_t>(read.mesh.labels.size());
    const std::vector<double> labels = xml.values(cell_data + name, cells);
    std::transform(labels.begin(), labels.end(), read.mesh.labels.data(),
                   [&](double label) { return checked_integer(label, 1, 2147483647, what.c_str(), file); });
    if (lower_case(name) != "label") read.notes.push_back("its labels are those of the cell array '" + name + "'");
}

}  // namespace

MeshFile detail::read_vtu_with_notes(const std::filesystem::path& path) {
    FileReader file(path);
    const VtkXml xml(file, data_type);
    const std::size_t point_count = xml.count("NumberOfPoints"), cell_count = xml.count("NumberOfCells");
    require_tetrahedra(xml, cell_count, file);
    const std::vector<double> points = xml.values("Points/", 3 * point_count),
                              nodes = xml.values("Cells/connectivity", 4 * cell_count);
    MeshFile read;
    TetMesh& mesh = read.mesh;
    mesh.nodes = Eigen::Map<const Eigen::Matrix3Xd>(points.data(), 3, static_cast<Eigen::Index>(point_count));
    mesh.tets.resize(4, static_cast<Eigen::Index>(cell_count));
    mesh.labels.resize(mesh.tets.cols());
    std::transform(nodes.begin(), nodes.end(), mesh.tets.data(),
                   [&](double node) { return checked_integer(node, 0, mesh.node_count() - 1, "node index", file); });
    read_labels(xml, file, read);
    orient(mesh);
    require_valid(mesh, path.string().c_str());
    return read;
}

TetMesh read_vtu(const std::filesystem::path& path, Observer& observer) {
    MeshFile read = detail::read_vtu_with_notes(path);
    for (const std::string& note : read.notes) observer.note(note_of(path, note));
    return std::move(read.mesh);
}

Eigen::MatrixXd read_vtu_cell_array(const std::filesystem::path& path, const std::string& name) {
    const std::string key = cell_data + name;
    FileReader file(path);
    const VtkXml xml(file, data_type);
    if (!xml.has(key)) {
        const std::string names = quoted_list(cell_arrays(xml));
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
