#include "meshing/point_table.hpp"

#include "core/errors.hpp"
#include "core/free_text.hpp"
#include "core/length_units.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>

namespace tissuewarp::meshing {

namespace {

using Row = TextTable::Row;

constexpr const char* axes_needed = "name the columns x,y,z (LPS mm), or r,a,s";

/// A column's name without its unit and its frame.
struct ColumnName {
    std::string axis, unit;
    bool says_frame = false, ras = false;
};

/// Cuts "(mm)", "[mm]", "_mm" or " mm" from a name, of any unit of length, and returns the unit.
std::string cut_unit(std::string& name) {
    const std::size_t cut = name.find_last_of("([_ ");
    if (cut == std::string::npos || cut == 0) return "";
    std::string unit = name.substr(cut + 1);
    while (!unit.empty() && (unit.back() == ')' || unit.back() == ']')) unit.pop_back();
    if (!millimetres_per(unit)) return "";
    name = trimmed(std::string_view(name).substr(0, cut));
    return unit;
}

/// "points:0" of ParaView, "x_ras", "left": one letter where the name is of an axis.
ColumnName column_name(const std::string& text) {
    static const std::map<std::string, std::string> words{
        {"points:0", "x"},   {"points:1", "y"},   {"points:2", "z"},   {"points_0", "x"},   {"points_1", "y"},
        {"points_2", "z"},   {"left", "l"},       {"right", "r"},      {"anterior", "a"},   {"posterior", "p"},
        {"superior", "s"},   {"inferior", "i"},   {"normals:0", "nx"}, {"normals:1", "ny"}, {"normals:2", "nz"},
        {"normals_0", "nx"}, {"normals_1", "ny"}, {"normals_2", "nz"}, {"normal_x", "nx"},  {"normal_y", "ny"},
        {"normal_z", "nz"},  {"normalx", "nx"},   {"normaly", "ny"},   {"normalz", "nz"},   {"n_x", "nx"},
        {"n_y", "ny"},       {"n_z", "nz"}};
    ColumnName name{lower_case(text), ""};
    name.unit = cut_unit(name.axis);
    for (const std::string frame : {"ras", "lps"}) {
        const bool behind = name.axis.ends_with("_" + frame), before = name.axis.starts_with(frame + "_");
        if (!behind && !before) continue;
        name.axis = behind ? name.axis.substr(0, name.axis.size() - 4) : name.axis.substr(4);
        name.ras = frame == "ras";
        name.says_frame = true;
    }
    if (const auto word = words.find(name.axis); word != words.end()) name.axis = word->second;
    return name;
}

std::size_t find_column(const TextTable& table, const std::vector<std::string>& header, const std::string& wanted) {
    std::size_t found = header.size();
    for (std::size_t c = 0; c < header.size(); ++c) {
        if (lower_case(header[c]) != wanted) continue;
        if (found < header.size()) table.refuse(table.header_line(), "the header names '" + wanted + "' twice");
        found = c;
    }
    return found;
}

/// One of three columns: its letters, the first of them along LPS.
struct Axis {
    char plain, along, against;
};
constexpr std::array<Axis, 3> axes{{{'x', 'l', 'r'}, {'y', 'p', 'a'}, {'z', 's', 'i'}}};

/// Columns named by one letter each behind the prefix, or nothing where one is missing.
template <class SignOf>
std::optional<AxisColumns> columns_by_letters(const TextTable& table, const std::vector<std::string>& header,
                                              const std::string& prefix, const SignOf& sign_of) {
    AxisColumns found;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        int count = 0;
        for (std::size_t c = 0; c < header.size(); ++c) {
            std::string text = lower_case(header[c]);
            if (!text.starts_with(prefix)) continue;
            const ColumnName name = column_name(text.substr(prefix.size()));
            const double sign = sign_of(axes[axis], name);
            if (sign == 0) continue;
            if (!name.unit.empty() && name.unit != "mm")
                table.refuse(table.header_line(),
                             "the column '" + header[c] + "' is in " + name.unit + "; coordinates in mm are needed");
            found.column[axis] = c;
            found.name[axis] = header[c];
            found.signs[static_cast<Eigen::Index>(axis)] = name.ras && axis < 2 ? -sign : sign;
            found.says_frame |= name.says_frame;
            ++count;
        }
        if (count > 1)
            table.refuse(table.header_line(), std::string("the header names two columns for ") + axes[axis].plain);
        if (count == 0) return std::nullopt;
    }
    return found;
}

double sign_of_plain(const Axis& axis, const ColumnName& name) {
    return name.axis == std::string(1, axis.plain) ? 1 : 0;
}

double sign_of_direction(const Axis& axis, const ColumnName& name) {
    if (name.axis == std::string(1, axis.along)) return 1;
    return name.axis == std::string(1, axis.against) ? -1 : 0;
}

/// The frame that remarks name; empty where they name none.
std::string frame_in_remarks(const TextTable& table) {
    std::string frame;
    for (const TextTable::Remark& remark : table.remarks()) {
        for (const std::string& named : frames_in(remark.text)) {
            if (named != "RAS" && named != "LPS")
                table.refuse(remark.line,
                             "says that its points are in the frame " + named + "; write them as LPS or RAS");
            if (!frame.empty() && frame != named)
                table.refuse(remark.line, "the remarks name both RAS and LPS; leave the one in which the points are");
            frame = named;
        }
    }
    return frame;
}

void require_millimetres_in_remarks(const TextTable& table) {
    for (const TextTable::Remark& remark : table.remarks())
        if (const std::string unit = foreign_unit_in(remark.text); !unit.empty())
            table.refuse(remark.line, "says that its unit is " + unit + "; coordinates in mm are needed");
}

/// A column that names points, where others may number rows.
bool is_title(const std::string& column) {
    return column == "label" || column == "name";
}

/// A number that says whether a point counts; decimal commas are seen through.
std::optional<double> state_number(std::string word) {
    std::replace(word.begin(), word.end(), ',', '.');
    double value = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc{} || end != word.data() + word.size() || !std::isfinite(value)) return std::nullopt;
    return value;
}

/// 0, 1, 2, ... or 1, 2, 3, ... in their order.
bool count_rows(const std::vector<std::string>& names) {
    for (const std::size_t first : {0U, 1U}) {
        std::size_t n = 0;
        while (n < names.size() && names[n] == std::to_string(n + first)) ++n;
        if (n == names.size()) return true;
    }
    return false;
}

class PointTableReader {
public:
    explicit PointTableReader(const std::filesystem::path& path) : table_(path) {}

    PointTable read() {
        if (table_.rows().empty() && table_.header().empty())
            throw InvalidInput(table_.path().string() +
                               ": the file is empty; a header that names x,y,z and one row per point are needed");
        take_first_lines();
        table_.require_even_rows();
        header_ = table_.header().empty() ? header_in_remark() : table_.header();
        find_columns();
        find_further_columns();
        for (const Row& row : table_.rows()) take(row);
        finish();
        return std::move(result_);
    }

private:
    TextTable table_;
    std::vector<std::string> header_;
    AxisColumns axes_{{0, 1, 2}, {"x", "y", "z"}};
    std::optional<AxisColumns> normals_;
    std::vector<Eigen::Vector3d> points_, directions_;
    std::size_t label_ = 0, line_ = 0;
    std::vector<std::size_t> states_;
    std::vector<std::string> left_out_;
    PointTable result_;

    /// Lines that stand before the columns in files of some programs: a count of the points, a title.
    void take_first_lines() {
        if (const long long count = table_.take_count())
            note("its first row, " + std::to_string(count) + ", is the number of points that follow");
        if (table_.line_of_numbers() > 0)
            note("line " + std::to_string(table_.line_of_numbers()) + " numbers the columns and is no point");
        if (table_.header().empty() || table_.rows().empty() || axis_columns(table_, table_.header())) return;
        if (axis_columns(table_, words_of(joined(table_.rows()[0].fields))))
            table_.refuse(table_.header_line(),
                          "this line stands before the names of the columns; take it out, or begin it with #");
    }

    /// "# x,y,z" or "//X Y Z": the remark before the first row, where it has as many words as rows have fields.
    std::vector<std::string> header_in_remark() {
        const std::size_t columns = table_.rows().front().fields.size();
        std::vector<std::string> found;
        for (const TextTable::Remark& remark : table_.remarks()) {
            if (remark.line > table_.rows().front().line) break;
            std::vector<std::string> words = words_of(remark.text);
            const bool named = words.size() == columns && axis_columns(table_, words).has_value();
            if (named) found = std::move(words);
        }
        return found;
    }

    void find_columns() {
        if (!header_.empty()) return find_named_columns();
        const std::size_t columns = table_.rows().front().fields.size();
        if (table_.has_commas_of_both_kinds())
            table_.refuse(table_.rows().front().line,
                          "commas stand between columns and for decimal marks alike; separate columns by semicolons");
        if (columns != 3 && columns != 6)
            table_.refuse(table_.rows().front().line,
                          std::to_string(columns) +
                              " columns without a header; 3 (x,y,z) or 6 (with a unit normal) are read so, " +
                              "for others " + axes_needed + " in a first row");
        if (columns == 6) normals_ = AxisColumns{{3, 4, 5}, {"column 4", "column 5", "column 6"}};
        turn_by_remark();
    }

    void find_named_columns() {
        const auto found = axis_columns(table_, header_);
        if (!found)
            table_.refuse(table_.header_line(), "the header '" + joined(header_) +
                                                    "' does not say which columns are coordinates; " + axes_needed);
        axes_ = *found;
        if (!turn_by_remark() && axes_.signs != Eigen::Vector3d(1, 1, 1))
            note("the columns " + axes_.name[0] + ", " + axes_.name[1] + ", " + axes_.name[2] + " were turned to LPS");
        normals_ = columns_by_letters(table_, header_, "", [](const Axis& axis, const ColumnName& name) {
            return name.axis == std::string("n") + axis.plain ? 1.0 : 0.0;
        });
    }

    /// Where axes are x, y and z and a remark says RAS.
    bool turn_by_remark() {
        const bool turned = turn_by_remarks(table_, axes_);
        if (turned) note("says that its points are RAS; they were turned to LPS");
        return turned;
    }

    /// Columns that say more of a point; those that there are not are past the last.
    void find_further_columns() {
        label_ = name_column(table_, header_);
        line_ = find_column(table_, header_, "line");
        states_ = state_columns(table_, header_);
    }

    void take(const Row& row) {
        if (!row_counts(table_, row, states_)) {
            left_out_.push_back(label_ < header_.size() ? row.fields[label_] : "line " + std::to_string(row.line));
            return;
        }
        points_.push_back(axes_.point(table_, row));
        if (normals_) directions_.push_back(direction(row));
        if (label_ < header_.size()) result_.names.push_back(row.fields[label_]);
        if (line_ < header_.size()) result_.groups.push_back(row.fields[line_]);
    }

    /// A normal in LPS. Numbers without a name are normals where they have unit length, or zero; named ones are scaled.
    Eigen::Vector3d direction(const Row& row) const {
        const Eigen::Vector3d normal = axes_.signs.cwiseProduct(normals_->point(table_, row));
        const double length = normal.norm();
        if (length == 0) return normal;
        if (header_.empty() && std::abs(length - 1) > 0.02)
            table_.refuse(row.line, "columns 4 to 6 (" + row.fields[3] + ", " + row.fields[4] + ", " + row.fields[5] +
                                        ") are no normal of length 1; name the columns in a first row, x,y,z,r,g,b for "
                                        "colours or x,y,z,nx,ny,nz for normals of any length");
        return normal / length;
    }

    void note(const std::string& text) { result_.notes.push_back(note_of(table_.path(), text)); }

    static std::string joined(const std::vector<std::string>& texts) {
        std::string all;
        for (const std::string& text : texts) all += (all.empty() ? "" : ", ") + text;
        return all;
    }

    static Eigen::Matrix3Xd matrix(const std::vector<Eigen::Vector3d>& columns) {
        Eigen::Matrix3Xd result(3, static_cast<Eigen::Index>(columns.size()));
        for (std::size_t n = 0; n < columns.size(); ++n) result.col(static_cast<Eigen::Index>(n)) = columns[n];
        return result;
    }

    void finish() {
        if (points_.empty())
            throw InvalidInput(table_.path().string() + ": holds no point; at least one row is needed");
        result_.points = matrix(points_);
        result_.normals = matrix(directions_);
        if (!left_out_.empty()) note("points that are not placed or hidden are left out: " + joined(left_out_));
        if (table_.has_decimal_commas()) note("its numbers have decimal commas");
        result_.blank_line = table_.blank_line();
        result_.names_count_rows =
            label_ < header_.size() && !is_title(lower_case(header_[label_])) && count_rows(result_.names);
        if (result_.blank_line > 0 && result_.names.empty())
            note("line " + std::to_string(result_.blank_line) +
                 " is empty and others follow; is a point missing there?");
    }
};

}  // namespace

Eigen::Vector3d AxisColumns::point(const TextTable& table, const TextTable::Row& row) const {
    Eigen::Vector3d point;
    for (std::size_t axis = 0; axis < 3; ++axis)
        point[static_cast<Eigen::Index>(axis)] = table.coordinate(row, column[axis], name[axis]);
    return signs.cwiseProduct(point);
}

std::optional<AxisColumns> axis_columns(const TextTable& table, const std::vector<std::string>& header,
                                        std::string_view prefix) {
    const std::string before(prefix);
    if (auto plain = columns_by_letters(table, header, before, sign_of_plain)) return plain;
    auto directions = columns_by_letters(table, header, before, sign_of_direction);
    if (directions) directions->says_frame = true;
    return directions;
}

bool turn_by_remarks(const TextTable& table, AxisColumns& columns) {
    require_millimetres_in_remarks(table);
    if (columns.says_frame || frame_in_remarks(table) != "RAS") return false;
    columns.signs = {-1, -1, 1};
    return true;
}

std::size_t name_column(const TextTable& table, const std::vector<std::string>& header) {
    for (const char* name : {"label", "name", "landmark", "point", "id"})
        if (const std::size_t column = find_column(table, header, name); column < header.size()) return column;
    return header.size();
}

std::vector<std::size_t> state_columns(const TextTable& table, const std::vector<std::string>& header,
                                       const std::string& prefix) {
    std::vector<std::size_t> columns;
    for (const char* name : {"defined", "visible"})  // of 3D Slicer: 0 for points that are not placed, or hidden
        if (const std::size_t c = find_column(table, header, prefix + name); c < header.size()) columns.push_back(c);
    return columns;
}

bool row_counts(const TextTable& table, const TextTable::Row& row, const std::vector<std::size_t>& states) {
    bool counts = true;
    for (const std::size_t column : states) {
        const std::string word = lower_case(trimmed(row.fields[column]));
        const bool yes = word == "true" || word == "yes", no = word == "false" || word == "no";
        const std::optional<double> number = state_number(word);
        if (!yes && !no && !number)
            table.refuse(row.line, "'" + row.fields[column] + "' does not say whether the point counts; write 1 or 0");
        counts = counts && !no && (yes || *number != 0);
    }
    return counts;
}

PointTable read_point_table(const std::filesystem::path& path) {
    return PointTableReader(path).read();
}

}  // namespace tissuewarp::meshing
