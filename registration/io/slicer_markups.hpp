#pragma once
/// Point lists of 3D Slicer.

#include "core/observer.hpp"

#include <Eigen/Core>

#include <filesystem>
#include <string>
#include <vector>

namespace tissuewarp::registration {

struct Markups {
    Eigen::Matrix3Xd points;          ///< 3 × P, LPS mm
    std::vector<std::string> labels;  ///< as many, or none
    /// Points of each list that is a line or a curve, in their order; a closed one ends with its first point again.
    std::vector<std::vector<int>> lines;
};

/// By the file's name: .mrk.json, .json or .fcsv.
bool is_slicer_markups(const std::filesystem::path& path);

/// Reads the points of all lists of a .mrk.json file or those of an .fcsv file; of curves the control points. Slicer
/// wrote RAS and writes LPS: what the file says counts, and a file that does not say is refused. Points that are not
/// placed or hidden are left out, with a note that names them. Throws IoError and InvalidInput, with the line where
/// there is one, also for units other than mm and for files without a point.
Markups read_slicer_markups(const std::filesystem::path& path, Observer& observer = silent_observer());

/// A point of a list that is written.
struct MarkupPoint {
    std::string label, description;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< LPS mm
};

/// Writes a .mrk.json file with one list of points, LPS mm. Complete or absent. Throws IoError.
void write_slicer_markups(const std::vector<MarkupPoint>& points, const std::filesystem::path& path);

}  // namespace tissuewarp::registration
