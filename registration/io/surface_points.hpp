#pragma once
/// Files of surface points seen during the operation.

#include "core/observer.hpp"
#include "registration/intraoperative.hpp"

#include <filesystem>

namespace tissuewarp::registration {

/// Reads .ply (ascii, binary), .stl, .obj, .vtk (legacy polydata), .vtp (XML polydata), .csv and .xyz
/// (meshing/point_table.hpp), with what normals the file holds, or those of its triangles. `deviation_mm` is taken
/// over. What was turned to LPS is noted. Throws IoError or InvalidInput naming the
/// file, also where the extent cannot be that of tissue in mm.
SurfacePoints read_surface_points(const std::filesystem::path& path, double deviation_mm = 1.0,
                                  Observer& observer = silent_observer());

/// Throws InvalidInput unless there are at least ten finite points, normals that are unit or absent, a positive finite
/// deviation, and an extent between 3 mm and 2 m, outliers aside.
void require_usable(const SurfacePoints& surface);

}  // namespace tissuewarp::registration
