#include "registration/io/slicer_markups.hpp"

#include "core/errors.hpp"
#include "registration/io/line_reader.hpp"

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

std::string lower(std::string text) {
    std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
    return text;
}

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

/// Columns of an .fcsv file as its remark names them; these of every version where it has none.
std::vector<std::string> usual_columns() {
    return {"id", "x", "y", "z", "ow", "ox", "oy", "oz", "vis", "sel", "lock", "label", "desc", "associatedNodeID"};
}

class FcsvReader {
public:
    explicit FcsvReader(const std::filesystem::path& path) : path_(path), reader_(path) {}

    Markups read() {
        Markups markups;
        while (reader_.next_of_any_kind()) {
            if (detail::trimmed(reader_.line()).front() == '#')
                take_remark();
            else
                take_point(markups);
        }
        return markups;
    }

private:
    std::filesystem::path path_;
    detail::LineReader reader_;
    std::string system_;
    std::vector<std::string> columns_ = usual_columns();

    void take_remark() {
        const std::string_view line = reader_.line();
        const std::size_t equals = line.find('=');
        if (equals == std::string_view::npos) return;
        const std::string_view name = detail::trimmed(line.substr(1, equals - 1));
        if (name == "CoordinateSystem") system_ = detail::trimmed(line.substr(equals + 1));
        if (name != "columns") return;
        columns_.clear();
        for (const std::string_view column : detail::split(line.substr(equals + 1), ',')) columns_.emplace_back(column);
    }

    [[nodiscard]] std::string_view field(const std::vector<std::string_view>& fields, std::string_view name) const {
        const auto at = static_cast<std::size_t>(std::find(columns_.begin(), columns_.end(), name) - columns_.begin());
        return at < fields.size() && at < columns_.size() ? fields[at] : std::string_view();
    }

    void take_point(Markups& markups) {
        if (system_.empty())
            reader_.refuse("no line '# CoordinateSystem = LPS' (or RAS) stands before the points; add the right one");
        const std::vector<std::string_view> fields = detail::split(reader_.line(), ',');
        const Eigen::Vector3d point{reader_.coordinate(field(fields, "x"), "x"),
                                    reader_.coordinate(field(fields, "y"), "y"),
                                    reader_.coordinate(field(fields, "z"), "z")};
        add(markups, signs_of(system_, path_.string()).cwiseProduct(point), std::string(field(fields, "label")));
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

/// "mm", or a list that begins with it.
void require_millimetres(const json& list, const std::string& where) {
    const auto units = list.find("coordinateUnits");
    if (units == list.end()) return;
    const json& first = units->is_array() && !units->empty() ? units->front() : *units;
    if (first != "mm") throw InvalidInput(where + ": coordinateUnits is " + units->dump() + "; save the points in mm");
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

void take_list(const json& list, const std::string& where, Markups& markups) {
    if (!list.is_object()) throw InvalidInput(where + ": is no list of points");
    require_millimetres(list, where);
    const Eigen::Vector3d signs = signs_of(system_of(list, where), where);
    const auto points = list.find("controlPoints");
    if (points == list.end() || !points->is_array()) throw InvalidInput(where + ": has no controlPoints");
    const int first = static_cast<int>(markups.points.cols());
    for (const json& point : *points) {
        const std::string place = where + ", point " + std::to_string(&point - &points->front() + 1);
        if (!point.is_object()) throw InvalidInput(place + ": is no point");
        if (point.value("positionStatus", std::string("defined")) != "defined") continue;
        add(markups, signs.cwiseProduct(position_of(point, place)), point.value("label", std::string()));
    }
    take_line(list, first, markups);
}

Markups read_json(const std::filesystem::path& path) {
    const json file = parsed(path);
    const auto lists = file.find("markups");
    if (!file.is_object() || lists == file.end() || !lists->is_array())
        throw InvalidInput(path.string() + ": has no \"markups\"; give a point list saved by 3D Slicer");
    Markups markups;
    try {
        for (std::size_t i = 0; i < lists->size(); ++i)
            take_list((*lists)[i], path.string() + ", list " + std::to_string(i + 1), markups);
    } catch (const json::exception& error) {
        throw InvalidInput(path.string() + ": is no point list of 3D Slicer: " + error.what());
    }
    return markups;
}

}  // namespace

bool is_slicer_markups(const std::filesystem::path& path) {
    const std::string extension = lower(path.extension().string());
    return extension == ".json" || extension == ".fcsv";
}

Markups read_slicer_markups(const std::filesystem::path& path) {
    const bool fcsv = lower(path.extension().string()) == ".fcsv";
    Markups markups = fcsv ? FcsvReader(path).read() : read_json(path);
    if (markups.labels.empty()) throw InvalidInput(path.string() + ": holds no placed point");
    return markups;
}

}  // namespace tissuewarp::registration
