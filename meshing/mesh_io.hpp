#pragma once
/// Mesh files. VTU is written by hand (appended raw binary, little-endian) so that ParaView and Slicer read it.

#include "core/observer.hpp"
#include "meshing/tet_mesh.hpp"

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace tissuewarp::meshing {

/// A named array on nodes or cells: C × N, float64 in memory, float32 in the file.
struct MeshArray {
    std::string name;
    Eigen::MatrixXd values;
};

/// Writes .vtu with the cell array `label`, plus the given point and cell arrays. Coordinates as float64, LPS mm.
/// Complete or absent: written to a temporary name and renamed. Throws IoError.
void write_vtu(const TetMesh& mesh, const std::filesystem::path& path, const std::vector<MeshArray>& point_arrays = {},
               const std::vector<MeshArray>& cell_arrays = {});

/// Reads a .vtu of tetrahedra: what write_vtu makes, and the variants that VTK and meshio write, ascii, inline or
/// appended, uncompressed or compressed by zlib, little-endian and in one piece. Labels are the cell array `label`, in
/// any case, or else meshio's `gmsh:physical`; where there is neither all have label 1, with a note where other arrays
/// may have been meant. Throws IoError or InvalidInput.
TetMesh read_vtu(const std::filesystem::path& path, Observer& observer = silent_observer());

/// Tetrahedra made by another program.
struct MeshFile {
    TetMesh mesh;
    std::map<int, std::string> label_names;  ///< of regions that the file names
    std::vector<std::string> notes;          ///< what the reader had to decide or doubts
};

/// Reads .vtu (as read_vtu), .msh (Gmsh 2.2 and 4.1, ascii; label: physical group, else the volume it belongs to) and
/// .inp (Abaqus, C3D4; label: element sets in their order) by extension. Lengths are mm. Tetrahedra that are all
/// inverted are turned, some of them are refused; nodes that none uses are left out. Throws IoError or InvalidInput.
MeshFile read_tetrahedra(const std::filesystem::path& path);

/// A cell array of a .vtu, components × cells in the order of the file. Throws IoError or, naming those that there are,
/// InvalidInput.
Eigen::MatrixXd read_vtu_cell_array(const std::filesystem::path& path, const std::string& name);

/// Surface with optional unit normals per node (3 × N or empty).
struct Surface {
    SurfaceMesh mesh;
    Eigen::Matrix3Xd normals;
};

/// Reads .ply, .stl, .obj, .vtk (legacy polydata), .vtp (XML polydata, as .vtu) and tables of points .csv/.xyz
/// (point_table.hpp) by extension. Points that the file says to be RAS ("SPACE=RAS", as 3D Slicer writes) are turned to
/// LPS, with a note. Point clouds have no triangles. Throws IoError or InvalidInput.
Surface read_surface(const std::filesystem::path& path, Observer& observer = silent_observer());

/// Points, some of them joined by lines: indices of nodes, two at least each.
struct Polylines {
    Eigen::Matrix3Xd nodes;  ///< 3 × N, mm, LPS
    std::vector<std::vector<int>> lines;
};

/// Reads the lines of VTK polydata, legacy (.vtk) or XML (.vtp), turned as surfaces are. Throws IoError or
/// InvalidInput.
Polylines read_polylines(const std::filesystem::path& path, Observer& observer = silent_observer());

/// Writes .ply (binary), .stl, .obj, .vtk or .vtp by extension. Complete or absent. Throws IoError.
void write_surface(const SurfaceMesh& surface, const std::filesystem::path& path);

/// Writes .vtp with arrays on the nodes; programs show the first one as colours. Complete or absent. Throws IoError,
/// and InvalidInput for arrays of another length.
void write_vtp(const SurfaceMesh& surface, const std::filesystem::path& path,
               const std::vector<MeshArray>& point_arrays);

}  // namespace tissuewarp::meshing
