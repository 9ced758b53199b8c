#include "registration/dial/fronts_io.hpp"

#include "core/atomic_file.hpp"
#include "core/file_message.hpp"
#include "core/user_cache.hpp"
#include "registration/dial/shipped_fronts.hpp"

#include <nlohmann/json.hpp>

#include <cmath>
#include <fstream>
#include <sstream>
#include <utility>

namespace tissuewarp::registration {

namespace {

using nlohmann::json;

constexpr const char* schema = "tissuewarp.fronts";
constexpr int schema_version = 3;

struct Key {
    const char* name;
    double FrontPoint::*value;
};
constexpr Key keys[] = {{"edges_per_organ", &FrontPoint::edges_per_organ},
                        {"tetrahedra", &FrontPoint::tetrahedra},
                        {"preparation_s", &FrontPoint::preparation_s},
                        {"rounds_s", &FrontPoint::rounds_s},
                        {"rounds_95_s", &FrontPoint::rounds_95_s},
                        {"fields_s", &FrontPoint::fields_s},
                        {"error_mm", &FrontPoint::error_mm},
                        {"error_95_mm", &FrontPoint::error_95_mm}};

json to_json(const LinearCost& cost) {
    return {{"constant_s", cost.constant_s}, {"slope_s", cost.slope_s}};
}

/// Reads with words for what is wrong.
class Reader {
public:
    explicit Reader(std::string source) : source_(std::move(source)) {}

    [[nodiscard]] const json& member(const json& object, const std::string& key) const {
        if (!object.is_object() || !object.contains(key)) fail("'" + key + "' is missing");
        return object.at(key);
    }
    [[nodiscard]] double number(const json& object, const std::string& key) const {
        const json& value = member(object, key);
        if (!value.is_number() || !std::isfinite(value.get<double>()) || value.get<double>() < 0)
            fail("'" + key + "' is " + value.dump() + " and should be a number from 0");
        return value.get<double>();
    }
    [[nodiscard]] LinearCost cost(const json& object, const std::string& key) const {
        const json& entry = member(object, key);
        return {number(entry, "constant_s"), number(entry, "slope_s")};
    }
    [[nodiscard]] DataKind kind(const json& entry) const {
        for (const DataKind each : {DataKind::Labels, DataKind::Partial})
            if (member(entry, "data") == name_of(each)) return each;
        fail("'data' is " + member(entry, "data").dump() + " and should be \"labels\" or \"partial\"");
    }
    [[noreturn]] void fail(const std::string& what) const {
        throw InvalidInput(
            presentable(source_ + ": " + what + "; remove the file or run 'tissuewarp calibrate' again"));
    }

private:
    std::string source_;
};

}  // namespace

std::filesystem::path fronts_path() {
    return user_cache_file("fronts.json");
}

std::string to_json_text(const Fronts& fronts) {
    json points = json::array();
    for (const FrontPoint& point : fronts.points) {
        json entry{{"data", name_of(point.kind)}};
        for (const Key& key : keys) entry[key.name] = point.*key.value;
        points.push_back(entry);
    }
    const json document{{"schema", schema},
                        {"schema_version", schema_version},
                        {"machine", fronts.machine},
                        {"alignment_labels", to_json(fronts.alignment[0])},
                        {"alignment_partial", to_json(fronts.alignment[1])},
                        {"fields", to_json(fronts.fields)},
                        {"warp", to_json(fronts.warp)},
                        {"points", points}};
    return document.dump(1) + "\n";
}

Fronts fronts_from_json(const std::string& text, const std::string& source) {
    const Reader reader(source);
    const json document = json::parse(text, nullptr, false);
    if (document.is_discarded()) reader.fail("no JSON");
    if (reader.member(document, "schema") != schema || reader.member(document, "schema_version") != schema_version)
        reader.fail("not of schema " + std::string(schema) + ", version " + std::to_string(schema_version));
    Fronts fronts;
    const json& machine = reader.member(document, "machine");
    if (!machine.is_string()) reader.fail("'machine' is no text");
    fronts.machine = machine.get<std::string>();
    fronts.alignment[0] = reader.cost(document, "alignment_labels");
    fronts.alignment[1] = reader.cost(document, "alignment_partial");
    fronts.fields = reader.cost(document, "fields");
    fronts.warp = reader.cost(document, "warp");
    const json& points = reader.member(document, "points");
    if (!points.is_array() || points.empty()) reader.fail("'points' holds nothing");
    for (const json& entry : points) {
        FrontPoint point;
        point.kind = reader.kind(entry);
        for (const Key& key : keys) point.*key.value = reader.number(entry, key.name);
        if (point.edges_per_organ < 2 || point.edges_per_organ > 200)
            reader.fail("'edges_per_organ' is " + std::to_string(point.edges_per_organ) + " and should be 2 to 200");
        fronts.points.push_back(point);
    }
    return fronts;
}

Fronts known_fronts() {
    const std::filesystem::path path = fronts_path();
    if (path.empty() || !std::filesystem::exists(path)) return shipped_fronts();
    std::ifstream file(path);
    std::ostringstream text;
    text << file.rdbuf();
    if (!file) throw IoError(path.string() + ": cannot be read");
    Fronts fronts = fronts_from_json(text.str(), path.string());
    fronts.measured_here = true;
    return fronts;
}

Fronts shipped_fronts() {
    return fronts_from_json(detail::shipped_fronts_text, "the program's own figures");
}

void write_fronts(const Fronts& fronts, const std::filesystem::path& path) {
    require_writable_folder(path.parent_path());
    write_file(to_json_text(fronts), path);
}

}  // namespace tissuewarp::registration
