#include "report/detail/normalised.hpp"

#include <string>

namespace tissuewarp::report::detail {

namespace {

using nlohmann::json;

json member(const json& object, const std::string& key) {
    return object.is_object() && object.contains(key) ? object[key] : json();
}

json inputs_by_name(const json& list, const json& grids) {
    json inputs = json::object();
    for (const json& entry : list) {
        const json role = member(entry, "role");
        if (!role.is_string()) continue;
        const std::string name = role.get<std::string>();
        json input = {{"path", member(entry, "path")}, {"sha256", member(entry, "sha256")}};
        for (const std::string frame : {"moving", "fixed"}) {
            if (name != frame && name != frame + "-labels") continue;
            const json grid = member(grids, frame);
            input["geometry"] = {{"size", member(grid, "size")}, {"spacing", member(grid, "spacing_mm")}};
        }
        inputs[name] = std::move(input);
    }
    return inputs;
}

json stages_without_total(const json& timings) {
    json stages = json::array();
    for (const json& timing : timings)
        if (member(timing, "stage") != "total") stages.push_back(timing);
    return stages;
}

json errors_by_group(const json& landmarks) {
    json errors;
    for (const char* group : {"all", "moved"})
        for (const char* time : {"before", "after"}) {
            const json summary = member(member(landmarks, time), group);
            if (summary.is_object()) errors[group][time] = summary;
        }
    if (errors.contains("moved")) errors["moved"]["threshold_mm"] = member(landmarks, "moved_mm");
    return errors;
}

}  // namespace

json normalised(json report) {
    if (!report.is_object()) return json::object();
    const auto absent = [&](const char* key) { return !report.contains(key); };
    if (member(report, "inputs").is_array())
        report["inputs"] = inputs_by_name(report["inputs"], member(report, "grids"));
    if (absent("stages") && member(report, "timings").is_array())
        report["stages"] = stages_without_total(report["timings"]);
    if (absent("version")) report["version"] = member(member(report, "versions"), "tissuewarp");
    if (absent("peak_memory_mb") && member(report, "peak_memory_bytes").is_number())
        report["peak_memory_mb"] = report["peak_memory_bytes"].get<double>() / 1e6;
    if (absent("target_registration_error") && member(report, "landmarks").is_object())
        report["target_registration_error"] = errors_by_group(report["landmarks"]);
    const json alignment = member(report, "alignment");
    if (member(alignment, "matrix").is_null() && alignment.is_object())
        report["alignment"]["matrix"] = member(alignment, "moving_to_fixed");
    for (const char* time : {"before", "after"}) {
        const json measures = member(member(report, "overlap"), time);
        if (member(measures, "all").is_null() && measures.is_object() && measures.contains("union")) {
            report["overlap"][time]["all"] = measures["union"];
            report["overlap"][time].erase("union");
        }
    }
    return report;
}

}  // namespace tissuewarp::report::detail
