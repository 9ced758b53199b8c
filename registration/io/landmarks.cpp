#include "core/errors.hpp"
#include "core/text_table.hpp"
#include "meshing/point_table.hpp"
#include "registration/evaluation.hpp"
#include "registration/io/extent.hpp"
#include "registration/io/slicer_markups.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <map>
#include <string>
#include <string_view>

namespace tissuewarp::registration {

namespace {

using meshing::AxisColumns;

constexpr const char* pair_columns = "pre_x,pre_y,pre_z,intra_x,intra_y,intra_z";

Eigen::Matrix3Xd as_matrix(const std::vector<Eigen::Vector3d>& points) {
    Eigen::Matrix3Xd matrix(3, static_cast<Eigen::Index>(points.size()));
    for (std::size_t p = 0; p < points.size(); ++p) matrix.col(static_cast<Eigen::Index>(p)) = points[p];
    return matrix;
}

bool is_table(const std::filesystem::path& path) {
    const std::string extension = lower_case(path.extension().string());
    return extension == ".csv" || extension == ".xyz";
}

/// "point", the number of points, then x y z per line.
Eigen::Matrix3Xd read_elastix_points(const std::filesystem::path& path) {
    const TextTable table(path, ' ');
    if (table.header() != std::vector<std::string>{"point"}) {
        if (table.header().empty() && table.rows().empty())
            throw InvalidInput(path.string() +
                               ": the file is empty; a line 'point', a count and one point per line are needed");
        if (table.header().empty())
            throw InvalidInput(
                path.string() +
                ": does not start with 'point', a count and one point per line; name tables .csv or .xyz");
        table.refuse(table.header_line(), "starts with '" + table.header()[0].substr(0, 40) +
                                              "'; only files of physical points, starting with 'point', can be read");
    }
    const auto& rows = table.rows();
    const std::string text = rows.empty() ? "" : rows[0].fields[0];
    long long count = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), count);
    if (error != std::errc{} || end != text.data() + text.size() || count < 1 || rows[0].fields.size() != 1)
        table.refuse(table.header_line() + 1, "the second line must be the number of points, at least 1");
    std::vector<Eigen::Vector3d> points;
    for (std::size_t r = 1; r < rows.size(); ++r) {
        if (rows[r].fields.size() != 3)
            table.refuse(rows[r].line,
                         std::to_string(rows[r].fields.size()) + " numbers; a point needs three: x y z in mm");
        points.emplace_back(AxisColumns{{0, 1, 2}, {"x", "y", "z"}}.point(table, rows[r]));
    }
    if (static_cast<long long>(points.size()) != count)
        table.refuse(rows.back().line, "the file ends after " + std::to_string(points.size()) +
                                           " points; its second line promises " + std::to_string(count));
    return as_matrix(points);
}

struct PointList : Markups {
    int blank_line = 0;             ///< between the points of a table, where one may be missing; or 0
    bool names_count_rows = false;  ///< as a column `id` may
};

PointList read_points_as_they_are(const std::filesystem::path& path, Observer& observer) {
    if (is_slicer_markups(path)) return {read_slicer_markups(path, observer)};
    if (!is_table(path)) return {{read_elastix_points(path), {}, {}}};
    meshing::PointTable table = meshing::read_point_table(path);
    for (const std::string& note : table.notes) observer.note(note);
    return {{std::move(table.points), std::move(table.names), {}}, table.blank_line, table.names_count_rows};
}

PointList read_points_of_any_kind(const std::filesystem::path& path, Observer& observer) {
    PointList list = read_points_as_they_are(path, observer);
    detail::require_millimetres_of_points(list.points, path.string() + ": the points are");
    return list;
}

bool has_names(const Markups& markups) {
    return std::any_of(markups.labels.begin(), markups.labels.end(), [](const auto& name) { return !name.empty(); });
}

/// Names by which points are pairs. Numbers of rows are such where the other file's are in another order.
bool are_by_name(const PointList& from, const PointList& to) {
    return has_names(from) && has_names(to) && !(from.names_count_rows && to.names_count_rows);
}

/// Place of each name. Throws InvalidInput where one repeats or a point has none.
std::map<std::string, Eigen::Index> places_of(const Markups& markups, const std::filesystem::path& path) {
    std::map<std::string, Eigen::Index> places;
    for (std::size_t n = 0; n < markups.labels.size(); ++n) {
        const std::string& name = markups.labels[n];
        if (name.empty())
            throw InvalidInput(path.string() + ": point " + std::to_string(n + 1) +
                               " has no name and others have; name all points, or none");
        if (!places.try_emplace(name, static_cast<Eigen::Index>(n)).second)
            throw InvalidInput(path.string() + ": two points are named '" + name +
                               "'; name each differently, as in the other file");
    }
    return places;
}

std::string listed(const std::vector<std::string>& names) {
    constexpr std::size_t most = 10;
    std::string text;
    for (std::size_t i = 0; i < std::min(names.size(), most); ++i) text += (i > 0 ? ", " : "") + names[i];
    return text + (names.size() > most ? ", …" : "");
}

/// A point that is missing would shift the partners of all behind it.
void require_no_gap(const PointList& list, const std::filesystem::path& path) {
    if (list.blank_line > 0)
        throw InvalidInput(path.string() + ":" + std::to_string(list.blank_line) +
                           ": the line is empty, and points are pairs by their order; a point may be missing: name the "
                           "points in both files, or take the line out");
}

Landmarks paired_by_name(const Markups& from, const Markups& to, const std::filesystem::path& moving,
                         const std::filesystem::path& fixed, Observer& observer) {
    const auto from_places = places_of(from, moving), to_places = places_of(to, fixed);
    std::vector<Eigen::Vector3d> from_points, to_points;
    std::vector<std::string> alone;
    for (const std::string& name : from.labels) {  // in the order of the moving file
        const auto partner = to_places.find(name);
        if (partner == to_places.end()) {
            alone.push_back(name);
            continue;
        }
        from_points.emplace_back(from.points.col(from_places.at(name)));
        to_points.emplace_back(to.points.col(partner->second));
    }
    for (const std::string& name : to.labels)
        if (!from_places.contains(name)) alone.push_back(name);
    if (from_points.empty())
        throw InvalidInput("'" + moving.string() + "' (" + listed(from.labels) + ") and '" + fixed.string() + "' (" +
                           listed(to.labels) + ") share no name; give points that correspond the same name");
    if (!alone.empty())
        observer.note(note_of(moving, std::to_string(from_points.size()) + " points are pairs by name with '" +
                                          fixed.string() + "'; only one of the files has " + listed(alone)));
    return {as_matrix(from_points), as_matrix(to_points)};
}

/// The three columns behind a prefix.
AxisColumns columns_of(const TextTable& table, const std::string& prefix) {
    if (const auto columns = meshing::axis_columns(table, table.header(), prefix)) return *columns;
    for (const char axis : {'x', 'y', 'z'}) {
        const std::string name = prefix + axis;
        if (std::find(table.header().begin(), table.header().end(), name) == table.header().end())
            table.refuse(table.header_line(), "the header lacks the column " + name + "; it must name " + pair_columns);
    }
    table.refuse(table.header_line(), std::string("the header must name ") + pair_columns);
}

/// With a note of what was turned.
void turn_pairs_by_remarks(const TextTable& table, const std::array<AxisColumns*, 2>& sides, Observer& observer) {
    for (AxisColumns* columns : sides) {
        const bool by_remark = meshing::turn_by_remarks(table, *columns);
        const std::string names = columns->name[0] + ", " + columns->name[1] + ", " + columns->name[2];
        if (by_remark)
            observer.note(
                note_of(table.path(), "says that its points are RAS; the columns " + names + " were turned to LPS"));
        else if (columns->signs != Eigen::Vector3d(1, 1, 1))
            observer.note(note_of(table.path(), "the columns " + names + " were turned to LPS"));
    }
}

struct PairRows {
    std::vector<const TextTable::Row*> counting;
    std::vector<std::string> left_out;  ///< by name, or line
};

/// Rows that no column `defined` or `visible`, of the pair or of one of its points, excludes.
PairRows rows_that_count(const TextTable& table) {
    std::vector<std::size_t> states;
    for (const char* prefix : {"", "pre_", "intra_"})
        for (const std::size_t column : meshing::state_columns(table, table.header(), prefix)) states.push_back(column);
    const std::size_t name = meshing::name_column(table, table.header());
    PairRows rows;
    for (const TextTable::Row& row : table.rows()) {
        if (meshing::row_counts(table, row, states))
            rows.counting.push_back(&row);
        else
            rows.left_out.push_back(name < row.fields.size() ? row.fields[name] : "line " + std::to_string(row.line));
    }
    return rows;
}

}  // namespace

bool is_table_of_pairs(const std::filesystem::path& path) {
    if (!is_table(path)) return false;
    const TextTable table(path);
    return std::any_of(table.header().begin(), table.header().end(),
                       [](const std::string& name) { return lower_case(name).starts_with("intra_"); });
}

Landmarks read_landmarks(const std::filesystem::path& path, Observer& observer) {
    TextTable table(path);
    if (table.header().empty() && table.rows().empty())
        throw InvalidInput(path.string() + ": the file is empty; a header naming " + pair_columns + " is needed");
    if (table.header().empty())
        table.refuse(table.rows().front().line,
                     std::string("no header; a first row naming ") + pair_columns + " is needed");
    table.require_even_rows();
    AxisColumns moving = columns_of(table, "pre_"), fixed = columns_of(table, "intra_");
    turn_pairs_by_remarks(table, {&moving, &fixed}, observer);
    const PairRows rows = rows_that_count(table);
    std::vector<Eigen::Vector3d> from, to;
    for (const TextTable::Row* row : rows.counting) {
        from.push_back(moving.point(table, *row));
        to.push_back(fixed.point(table, *row));
    }
    if (from.empty()) table.refuse(table.header_line(), "no landmark follows the header; at least one row is needed");
    if (!rows.left_out.empty())
        observer.note(
            note_of(table.path(), "pairs that are not placed or hidden are left out: " + listed(rows.left_out)));
    if (table.has_decimal_commas()) observer.note(note_of(table.path(), "its numbers have decimal commas"));
    Landmarks landmarks{as_matrix(from), as_matrix(to)};
    for (const Eigen::Matrix3Xd* points : {&landmarks.moving, &landmarks.fixed})
        detail::require_millimetres_of_points(*points, path.string() + ": the landmarks are");
    return landmarks;
}

Landmarks read_landmarks(const std::filesystem::path& moving, const std::filesystem::path& fixed, Observer& observer) {
    PointList from = read_points_of_any_kind(moving, observer), to = read_points_of_any_kind(fixed, observer);
    if (are_by_name(from, to)) return paired_by_name(from, to, moving, fixed, observer);
    require_no_gap(from, moving);
    require_no_gap(to, fixed);
    if (from.points.cols() != to.points.cols())
        throw InvalidInput(moving.string() + " has " + std::to_string(from.points.cols()) + " points and " +
                           fixed.string() + " has " + std::to_string(to.points.cols()) +
                           "; corresponding points need equal numbers, or names in both files");
    if (has_names(from) != has_names(to))
        observer.note(
            note_of(has_names(from) ? fixed : moving, "its points have no names; they are pairs by their order"));
    return {std::move(from.points), std::move(to.points)};
}

Eigen::Matrix3Xd read_points(const std::filesystem::path& path, Observer& observer) {
    return read_points_of_any_kind(path, observer).points;
}

}  // namespace tissuewarp::registration
