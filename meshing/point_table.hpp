#pragma once
/// Tables of points: which columns are coordinates, in which frame, and what else a row says of its point.

#include "core/text_table.hpp"

#include <Eigen/Core>

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace tissuewarp::meshing {

/// Three columns that hold coordinates, and the signs that turn them into LPS.
struct AxisColumns {
    std::array<std::size_t, 3> column{};
    std::array<std::string, 3> name;  ///< as the file has them
    Eigen::Vector3d signs{1, 1, 1};

    /// Of a row, LPS mm. Throws InvalidInput.
    [[nodiscard]] Eigen::Vector3d point(const TextTable& table, const TextTable::Row& row) const;
};

/// The columns that a header calls x, y, z, or by directions (l or r, p or a, s or i, in words too), behind `prefix`,
/// in any order and case, with or without units or a frame ("x_ras", "x (mm)"). Nothing where it lacks one of them;
/// throws InvalidInput for two of one axis and for units other than mm.
std::optional<AxisColumns> axis_columns(const TextTable& table, const std::vector<std::string>& header,
                                        std::string_view prefix = "");

/// Points of one file, LPS mm.
struct PointTable {
    Eigen::Matrix3Xd points;          ///< 3 × P
    Eigen::Matrix3Xd normals;         ///< 3 × P, unit, or zero where one is not known; or none
    std::vector<std::string> names;   ///< as many, of the column `label` or `name`; or none
    std::vector<std::string> groups;  ///< as many, of the column `line`; or none
    std::vector<std::string> notes;   ///< what was turned, left out or taken, with the file's name
    int blank_line = 0;               ///< the first empty line between points, where one may be missing; or 0
};

/// Reads a table of points. Its header, or the remark before its first row, names the columns; without either, a file
/// has the columns x, y, z or x, y, z and a unit normal. Points that a column `defined` or `visible` of 3D Slicer marks
/// with 0 are left out. Throws IoError or InvalidInput, with the line.
PointTable read_point_table(const std::filesystem::path& path);

}  // namespace tissuewarp::meshing
