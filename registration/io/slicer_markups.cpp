#include "registration/io/slicer_markups.hpp"

#include "core/file_message.hpp"
#include "core/text_table.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <numeric>
#include <string_view>

namespace tissuewarp::registration {
namespace {

using nlohmann::json;

constexpr std::uintmax_t most_bytes = 64U << 20U;

/// Signs that turn coordinates of the named system into LPS; Slicer also wrote numbers for the names.
Eigen::Vector3d signs_of(std::string_view system, const std::string& where) {
    if (system == "LPS" || system == "1") return {1, 1, 1};
    if (system == "RAS" || system == "0") return {-1, -1, 1};
    throw InvalidInput(where + ": the coordinate system is '" + std::string(system.substr(0, 40)) +
                       "'; save the points in LPS or RAS");
}

void add(Markups& markups, const Eigen::Vector3d& point, std::string label) {
    markups.points.conservativeResize(3, markups.points.cols() + 1);
    markups.points.rightCols<1>() = point;
    markups.labels.push_back(std::move(label));
}

/// Why a point is left out; empty where it counts.
struct PointState {
    std::string name;
    std::string_view why;
};

void note_left_out(const std::vector<PointState>& points, const std::filesystem::path& path, Observer& observer) {
    if (points.empty()) return;
    std::string text;
    for (const PointState& point : points)
        text += (text.empty() ? "" : ", ") + point.name + " (" + std::string(point.why) + ")";
    observer.note(note_of(path, "points that do not count are left out: " + text));
}

/// Columns of an .fcsv file as its remark names them; these of every version where it has none. Two without a name
/// stand behind them since 5.4.
std::vector<std::string> usual_columns() {
    return {"id", "x", "y", "z", "ow", "ox", "oy", "oz", "vis", "sel", "lock", "label", "desc", "associatedNodeID"};
}

class FcsvReader {
public:
    explicit FcsvReader(const std::filesystem::path& path) : table_(path, ',') {}

    Markups read(Observer& observer) {
        for (const TextTable::Remark& remark : table_.remarks()) take_remark(remark.text);
        Markups markups;
        if (!table_.header().empty()) table_.refuse(table_.header_line(), "is no point, it has no number");
        for (const TextTable::Row& row : table_.rows()) take_point(row, markups);
        note_left_out(left_out_, table_.path(), observer);
        return markups;
    }

private:
    TextTable table_;
    std::string system_;
    std::vector<std::string> columns_ = usual_columns();
    std::vector<PointState> left_out_;

    void take_remark(std::string_view text) {
        const std::size_t equals = text.find('=');
        if (equals == std::string_view::npos) return;
        const std::string_view name = trimmed(text.substr(0, equals)), value = trimmed(text.substr(equals + 1));
        if (name == "CoordinateSystem") system_ = trimmed(value.substr(0, value.find(',')));
        if (name == "columns") columns_ = words_of(value);
    }

    /// Column of this name; one that no row has where there is none.
    [[nodiscard]] std::size_t column(std::string_view name) const {
        const auto at = std::find(columns_.begin(), columns_.end(), name);
        return at == columns_.end() ? std::string::npos : static_cast<std::size_t>(at - columns_.begin());
    }
    [[nodiscard]] std::string field(const TextTable::Row& row, std::size_t column) const {
        return column < row.fields.size() ? row.fields[column] : "";
    }
    [[nodiscard]] double coordinate(const TextTable::Row& row, const char* name) const {
        const std::size_t at = column(name);
        if (at >= row.fields.size()) table_.refuse(row.line, std::string(name) + " is ''; a number in mm is needed");
        return table_.coordinate(row, at, name);
    }

    /// The status since 5.4: 0 undefined, 1 previewed, 2 placed, 3 missing.
    [[nodiscard]] std::string_view why_left_out(const TextTable::Row& row) const {
        const std::string status = field(row, columns_.size());
        if (column("associatedNodeID") + 1 == columns_.size() && !status.empty() && status != "2")
            return status == "3" ? "missing" : "not placed";
        return field(row, column("vis")) == "0" ? "hidden" : "";
    }

    void take_point(const TextTable::Row& row, Markups& markups) {
        if (system_.empty())
            table_.refuse(row.line,
                          "no line '# CoordinateSystem = LPS' (or RAS) stands before the points; add the right one");
        const std::string label = field(row, column("label"));
        if (const std::string_view why = why_left_out(row); !why.empty()) {
            left_out_.push_back({label.empty() ? "line " + std::to_string(row.line) : label, why});
            return;
        }
        const Eigen::Vector3d point{coordinate(row, "x"), coordinate(row, "y"), coordinate(row, "z")};
        add(markups, signs_of(system_, table_.path().string()).cwiseProduct(point), label);
    }
};

json parsed(const std::filesystem::path& path) {
    std::ifstream file(path);
    if (!file || std::filesystem::is_directory(path))
        throw IoError(path.string() + ": cannot be opened; check that the file exists and may be read");
    if (std::filesystem::file_size(path) > most_bytes)
        throw InvalidInput(path.string() + ": has more than 64 MiB; a list of points is smaller");
    try {
        return json::parse(file);
    } catch (const json::exception& error) {
        throw InvalidInput(path.string() + ": is no JSON: " + error.what());
    }
}

/// "mm", or a list of it; a code of a dictionary counts by its first entry, ["mm", "UCUM", "millimeter"].
void require_millimetres(const json& list, const std::string& where) {
    const auto units = list.find("coordinateUnits");
    if (units == list.end()) return;
    const bool code = units->is_array() && units->size() > 1 && (*units)[1] == "UCUM";
    const bool listed = units->is_array() && !units->empty() && !code;
    const bool all = listed ? std::all_of(units->begin(), units->end(), [](const json& unit) { return unit == "mm"; })
                            : (code ? units->front() : *units) == "mm";
    if (!all) throw InvalidInput(where + ": coordinateUnits is " + units->dump() + "; save the points in mm");
}

std::string system_of(const json& list, const std::string& where) {
    const auto system = list.find("coordinateSystem");
    if (system == list.end())
        throw InvalidInput(where + ": has no coordinateSystem; add \"LPS\" or \"RAS\", whichever is right");
    return system->is_string() ? system->get<std::string>() : system->dump();
}

Eigen::Vector3d position_of(const json& point, const std::string& where) {
    const auto position = point.find("position");
    if (position == point.end() || !position->is_array() || position->size() != 3)
        throw InvalidInput(where + ": has no position of three numbers");
    Eigen::Vector3d result;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const json& value = (*position)[axis];
        if (!value.is_number() || !(std::abs(value.get<double>()) <= 1e6))
            throw InvalidInput(where + ": position holds " + value.dump().substr(0, 40) +
                               "; a finite coordinate in mm is needed");
        result[static_cast<Eigen::Index>(axis)] = value.get<double>();
    }
    return result;
}

/// The points from `first` on, as a line where the list is one.
void take_line(const json& list, int first, Markups& markups) {
    const std::string type = list.value("type", std::string("Fiducial"));
    const int count = static_cast<int>(markups.points.cols()) - first;
    if ((type != "Line" && type != "Curve" && type != "ClosedCurve") || count < 2) return;
    std::vector<int>& line = markups.lines.emplace_back(static_cast<std::size_t>(count));
    std::iota(line.begin(), line.end(), first);
    if (type == "ClosedCurve") line.push_back(first);
}

std::string_view why_left_out(const json& point) {
    const std::string status = point.value("positionStatus", std::string("defined"));
    if (status != "defined") return status == "missing" ? "missing" : "not placed";
    return point.value("visibility", true) ? "" : "hidden";
}

void take_list(const json& list, const std::string& where, Markups& markups, std::vector<PointState>& left_out) {
    if (!list.is_object()) throw InvalidInput(where + ": is no list of points");
    require_millimetres(list, where);
    const Eigen::Vector3d signs = signs_of(system_of(list, where), where);
    const auto points = list.find("controlPoints");
    if (points == list.end() || !points->is_array()) throw InvalidInput(where + ": has no controlPoints");
    const int first = static_cast<int>(markups.points.cols());
    for (const json& point : *points) {
        const std::string number = std::to_string(&point - &points->front() + 1), place = where + ", point " + number;
        if (!point.is_object()) throw InvalidInput(place + ": is no point");
        const std::string label = point.value("label", std::string());
        if (const std::string_view why = why_left_out(point); !why.empty())
            left_out.push_back({label.empty() ? "point " + number : label, why});
        else
            add(markups, signs.cwiseProduct(position_of(point, place)), label);
    }
    take_line(list, first, markups);
}

Markups read_json(const std::filesystem::path& path, Observer& observer) {
    const json file = parsed(path);
    const auto lists = file.find("markups");
    if (!file.is_object() || lists == file.end() || !lists->is_array())
        throw InvalidInput(path.string() + ": has no \"markups\"; give a point list saved by 3D Slicer");
    Markups markups;
    std::vector<PointState> left_out;
    try {
        for (std::size_t i = 0; i < lists->size(); ++i)
            take_list((*lists)[i], path.string() + ", list " + std::to_string(i + 1), markups, left_out);
    } catch (const json::exception& error) {
        throw InvalidInput(path.string() + ": is no point list of 3D Slicer: " + error.what());
    }
    note_left_out(left_out, path, observer);
    return markups;
}

}  // namespace

bool is_slicer_markups(const std::filesystem::path& path) {
    const std::string extension = lower_case(path.extension().string());
    return extension == ".json" || extension == ".fcsv";
}

Markups read_slicer_markups(const std::filesystem::path& path, Observer& observer) {
    const bool fcsv = lower_case(path.extension().string()) == ".fcsv";
    Markups markups = naming(path, [&] { return fcsv ? FcsvReader(path).read(observer) : read_json(path, observer); });
    if (markups.labels.empty())
        throw InvalidInput(path.string() + ": holds no placed point; place points, and show those that shall count");
    return markups;
}

}  // namespace tissuewarp::registration
