#pragma once
/// Files of vessels' centre lines and of points along them.

#include "meshing/mesh_io.hpp"
#include "registration/intraoperative.hpp"

#include <filesystem>

namespace tissuewarp::registration {

/// Points of one file, some of them joined by lines, LPS mm, of the kinds that read_curves takes. Throws IoError or
/// InvalidInput naming the file.
meshing::Polylines read_curve_file(const std::filesystem::path& path, Observer& observer = silent_observer());

/// Reads the preoperative lines and the intraoperative points, LPS mm: the lines of polydata, .vtk (legacy) or .vtp
/// (XML); markups of 3D Slicer, whose curves and lines are the polylines of their control points; or a table
/// of points whose header names a column line (meshing/point_table.hpp); rows with the same entry there are the points
/// of one line, in their order. Points of the fixed file need no line (column `line` absent or empty); those on a line
/// that is long enough get its tangent. `deviation_mm` is taken over. Throws IoError or InvalidInput naming the file.
Curves read_curves(const std::filesystem::path& moving, const std::filesystem::path& fixed, double deviation_mm = 1.0,
                   Observer& observer = silent_observer());

/// Throws InvalidInput unless there is a preoperative line and five intraoperative points, all finite, tangents that
/// are unit, zero or absent, a positive finite deviation, an extent of either between 3 mm and 2 m, outliers aside, and
/// at most 100 m of lines.
void require_usable(const Curves& curves);

/// The points of all lines, 3 × P.
Eigen::Matrix3Xd points_of(const std::vector<Eigen::Matrix3Xd>& lines);

/// Places along a polyline (3 × P, mm), evenly, about `step_mm` apart, the ends among them.
Eigen::Matrix3Xd evenly_along(const Eigen::Matrix3Xd& line, double step_mm);

/// Unit chords over at least `reach_mm` to either side along a polyline (3 × P, mm), to one side at its ends; 0 on one
/// that is shorter. Noise of deviation σ turns them by about σ/(√2 reach_mm) radians.
Eigen::Matrix3Xd tangents_along(const Eigen::Matrix3Xd& line, double reach_mm);

}  // namespace tissuewarp::registration
