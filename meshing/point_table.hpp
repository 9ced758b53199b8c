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
    bool says_frame = false;  ///< their names do, as directions or with a frame ("x_ras")

    /// Of a row, LPS mm. Throws InvalidInput.
    [[nodiscard]] Eigen::Vector3d point(const TextTable& table, const TextTable::Row& row) const;
};

/// The columns that a header calls x, y, z, or by directions (l or r, p or a, s or i, in words too), behind `prefix`,
/// in any order and case, with or without units or a frame ("x_ras", "x (mm)"). Nothing where it lacks one of them;
/// throws InvalidInput for two of one axis and for units other than mm.
std::optional<AxisColumns> axis_columns(const TextTable& table, const std::vector<std::string>& header,
                                        std::string_view prefix = "");

/// Turns columns whose names do not say their frame where a remark says that the points are RAS; true where it does.
/// Throws InvalidInput for remarks that name several frames, others than RAS and LPS, or a unit other than mm.
bool turn_by_remarks(const TextTable& table, AxisColumns& columns);

/// The column of the points' names: `label`, `name`, `landmark`, `point` or `id`, the first of them, in any case; the
/// header's size where there is none.
std::size_t name_column(const TextTable& table, const std::vector<std::string>& header);

/// Columns `defined` and `visible` behind the prefix, which say whether a row counts.
std::vector<std::size_t> state_columns(const TextTable& table, const std::vector<std::string>& header,
                                       const std::string& prefix = "");

/// False where one of these columns says 0, false or no; throws InvalidInput for what is neither that nor 1, true, yes.
bool row_counts(const TextTable& table, const TextTable::Row& row, const std::vector<std::size_t>& states);

/// Points of one file, LPS mm.
struct PointTable {
    Eigen::Matrix3Xd points;          ///< 3 × P
    Eigen::Matrix3Xd normals;         ///< 3 × P, unit, or zero where one is not known; or none
    std::vector<std::string> names;   ///< as many, of the column of names (name_column); or none
    bool names_count_rows = false;    ///< the names are 0, 1, 2, ... or 1, 2, 3, ... of a column `id` and its like
    std::vector<std::string> groups;  ///< as many, of the column `line`; or none
    std::vector<std::string> notes;   ///< what was turned, left out or taken, with the file's name
    int blank_line = 0;               ///< the first empty line between points, where one may be missing; or 0
};

/// Reads a table of points. Its header, or the remark before its first row, names the columns; without either, a file
/// has the columns x, y, z or x, y, z and a unit normal. Points that a column `defined` or `visible` of 3D Slicer marks
/// with 0, or false, are left out. Throws IoError or InvalidInput, with the line.
PointTable read_point_table(const std::filesystem::path& path);

}  // namespace tissuewarp::meshing
