#pragma once
/// One reader per surface format; the checks common to all stand in read_surface.

#include "meshing/detail/file_reader.hpp"
#include "meshing/mesh_io.hpp"

#include <vector>

namespace tissuewarp::meshing::detail {

/// What a reader collects: triangles and lines with the indices of the file, not yet checked.
struct RawSurface {
    std::vector<Eigen::Vector3d> nodes;
    std::vector<Eigen::Vector3d> normals;  ///< as many as nodes, or none
    std::vector<std::array<long long, 3>> triangles;
    std::vector<std::vector<long long>> lines;  ///< of VTK's files alone
    std::string space;                          ///< "LPS", "RAS", ...; empty where the file does not say
    std::string unit;                           ///< of length, as the file has it, where it says another than mm

    /// What a title, a remark or a comment says of frame and unit; the first counts.
    void take_free_text(std::string_view text);

    /// Cuts a polygon into a fan of triangles.
    void add_polygon(const std::vector<long long>& corners) {
        for (std::size_t k = 2; k < corners.size(); ++k) triangles.push_back({corners[0], corners[k - 1], corners[k]});
    }
};

RawSurface read_ply(FileReader& file);
RawSurface read_stl(FileReader& file);
RawSurface read_obj(FileReader& file);
RawSurface read_vtk_polydata(FileReader& file);  ///< legacy
RawSurface read_vtp(FileReader& file);

/// "RAS" of "SPACE=RAS", as 3D Slicer states the frame in the free text of a format, in any case; empty where the text
/// says no three directions.
std::string space_in(std::string_view text);

}  // namespace tissuewarp::meshing::detail
