#include "report/detail/view.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <set>
#include <string>

namespace tissuewarp::report::detail {

namespace {

using nlohmann::json;

/// The member, or null.
const json& at(const json& object, const std::string& key) {
    static const json nothing;
    if (!object.is_object()) return nothing;
    const auto found = object.find(key);
    return found == object.end() ? nothing : *found;
}

template <class... Keys>
const json& at(const json& object, const std::string& key, const Keys&... keys) {
    return at(at(object, key), keys...);
}

bool is_finite(const json& value) {
    return value.is_number() && std::isfinite(value.get<double>());
}

/// "–" for what is no finite number.
std::string number(const json& value, int decimals) {
    if (!is_finite(value)) return "–";
    char buffer[64];
    std::snprintf(buffer, sizeof buffer, "%.*f", decimals, value.get<double>());
    return buffer;
}

std::string percent(const json& share) {
    return is_finite(share) ? number(100 * share.get<double>(), 0) + " %" : "–";
}

std::string text(const json& value) {
    if (value.is_string()) return value.get<std::string>();
    if (value.is_null()) return "";
    if (value.is_number_float()) {
        char buffer[64];
        std::snprintf(buffer, sizeof buffer, "%.10g", value.get<double>());
        return buffer;
    }
    return value.dump(-1, ' ', false, json::error_handler_t::replace);
}

/// "175 × 212 × 170".
std::string product(const json& list, int decimals) {
    std::string line;
    if (!list.is_array()) return line;
    for (const json& value : list) line += (line.empty() ? "" : " × ") + number(value, decimals);
    return line;
}

json inputs_view(const json& inputs) {
    json rows = json::array();
    if (!inputs.is_object()) return rows;
    for (const auto& [name, input] : inputs.items())
        rows.push_back({{"name", name},
                        {"path", text(input.is_object() ? at(input, "path") : input)},
                        {"sha256", text(at(input, "sha256"))},
                        {"size", product(at(input, "geometry", "size"), 0)},
                        {"spacing", product(at(input, "geometry", "spacing"), 2)}});
    return rows;
}

/// Nested parameters by dotted names.
void flatten(const json& value, const std::string& name, json& rows) {
    if (value.is_object() && !value.empty()) {
        for (const auto& [key, member] : value.items()) flatten(member, name.empty() ? key : name + "." + key, rows);
    } else if (!name.empty()) {
        rows.push_back({{"name", name}, {"value", text(value)}});
    }
}

json stages_view(const json& stages) {
    json rows = json::array();
    double total = 0;
    if (!stages.is_array()) return nullptr;
    for (const json& stage : stages)
        if (is_finite(at(stage, "seconds"))) total += at(stage, "seconds").get<double>();
    for (const json& stage : stages) {
        const json& seconds = at(stage, "seconds");
        const double part = total > 0 && is_finite(seconds) ? 100 * seconds.get<double>() / total : 0;
        rows.push_back(
            {{"stage", text(at(stage, "stage"))}, {"seconds", number(seconds, 2)}, {"percent", number(part, 1)}});
    }
    if (rows.empty()) return nullptr;
    return {{"rows", rows}, {"total", number(total, 1)}};
}

json rounds_view(const json& rounds) {
    json rows = json::array();
    if (!rounds.is_array()) return rows;
    for (const json& round : rounds)
        rows.push_back({{"index", std::to_string(rows.size() + 1)},
                        {"range", number(at(round, "range_mm"), 1)},
                        {"matched", number(at(round, "matched"), 0)},
                        {"held_back", is_finite(at(round, "held_back")) ? number(at(round, "held_back"), 0) : "–"},
                        {"interface_nodes", number(at(round, "interface_nodes"), 0)},
                        {"residual", number(at(round, "mean_residual_mm"), 2)},
                        {"change", number(at(round, "largest_change_mm"), 2)},
                        {"evaluations", number(at(round, "force_evaluations"), 0)},
                        {"error", number(at(round, "estimated_error_mm"), 3)}});
    return rows;
}

json overlap_row(const std::string& label, const json& before, const json& after) {
    const json& name = at(after, "name");
    const std::string title = name.is_string() ? label + " " + name.get<std::string>() : label;
    return {{"label", label == "all" || label == "0" ? "" : title},
            {"all", label == "all" || label == "0"},
            {"dice_before", number(at(before, "dice"), 3)},
            {"dice_after", number(at(after, "dice"), 3)},
            {"distance_before", number(at(before, "mean_surface_distance_mm"), 2)},
            {"distance_after", number(at(after, "mean_surface_distance_mm"), 2)},
            {"hausdorff_before", number(at(before, "hausdorff_95_mm"), 2)},
            {"hausdorff_after", number(at(after, "hausdorff_95_mm"), 2)}};
}

/// Labels in the order of their numbers, their union last.
json overlap_view(const json& overlap) {
    const json &before = at(overlap, "before"), &after = at(overlap, "after");
    const auto by_number = [](const std::string& a, const std::string& b) {
        const bool all_a = a == "all" || a == "0", all_b = b == "all" || b == "0";
        if (all_a != all_b) return all_b;
        return a.size() != b.size() ? a.size() < b.size() : a < b;
    };
    std::set<std::string, decltype(by_number)> labels(by_number);
    for (const json* part : {&before, &after})
        if (part->is_object())
            for (const auto& [label, measures] : part->items()) labels.insert(label);
    json rows = json::array();
    for (const std::string& label : labels) rows.push_back(overlap_row(label, at(before, label), at(after, label)));
    return rows;
}

json error_row(const char* which, const json& errors) {
    if (!errors.is_object()) return nullptr;
    json row = {{which, true}, {"threshold", number(at(errors, "threshold_mm"), 1)}};
    for (const char* when : {"before", "after"}) {
        const json& summary = at(errors, when);
        if (is_finite(at(summary, "count"))) row["count"] = number(at(summary, "count"), 0);
        for (const char* measure : {"mean", "median", "percentile_95", "maximum"})
            row[std::string(measure) + "_" + when] = number(at(summary, measure), 2);
    }
    return row;
}

json errors_view(const json& errors) {
    json rows = json::array();
    for (const char* which : {"all", "moved"})
        if (const json row = error_row(which, at(errors, which)); row.is_object()) rows.push_back(row);
    return rows;
}

json jacobian_view(const json& jacobian) {
    json rows = json::array();
    for (const char* which : {"mesh", "field_in_organ", "field"}) {
        const json& values = at(jacobian, which);
        if (!values.is_object()) continue;
        const json& folded = at(values, "folded");
        rows.push_back({{which, true},
                        {"minimum", number(at(values, "minimum"), 3)},
                        {"percentile_1", number(at(values, "percentile_1"), 3)},
                        {"median", number(at(values, "median"), 3)},
                        {"percentile_99", number(at(values, "percentile_99"), 3)},
                        {"maximum", number(at(values, "maximum"), 3)},
                        {"folded", number(folded, 0)},
                        {"folded_mm3", number(at(values, "folded_mm3"), 1)},
                        {"folds", is_finite(folded) && folded.get<double>() > 0}});
    }
    return rows;
}

/// The tiles on top: what decides whether the result can be used.
json summary_view(const json& report) {
    json tiles;
    const json& error = at(report, "target_registration_error", "all");
    if (is_finite(at(error, "after", "mean")))
        tiles["landmarks"] = {{"before", number(at(error, "before", "mean"), 2)},
                              {"after", number(at(error, "after", "mean"), 2)},
                              {"maximum", number(at(error, "after", "maximum"), 2)},
                              {"count", number(at(error, "after", "count"), 0)}};
    for (const char* key : {"all", "0"}) {
        const json& after = at(report, "overlap", "after", key);
        if (!is_finite(at(after, "dice"))) continue;
        const json& before = at(report, "overlap", "before", key);
        tiles["organ"] = {{"before", number(at(before, "dice"), 3)},
                          {"after", number(at(after, "dice"), 3)},
                          {"distance_before", number(at(before, "mean_surface_distance_mm"), 2)},
                          {"distance_after", number(at(after, "mean_surface_distance_mm"), 2)}};
    }
    const json& mesh = at(report, "jacobian", "mesh");
    if (is_finite(at(mesh, "minimum"))) {
        const json& folded = at(mesh, "folded");
        tiles["volume"] = {{"minimum", number(at(mesh, "minimum"), 3)},
                           {"folded", number(folded, 0)},
                           {"folds", is_finite(folded) && folded.get<double>() > 0}};
    }
    if (const json& estimate = at(report, "error_estimate"); estimate.is_object()) {
        const json& unknown = at(estimate, "unknown_share");
        tiles["estimate"] = {{"deviation", number(at(estimate, "deviation_mm"), 2)},
                             {"interval", number(at(estimate, "interval_95_mm"), 2)},
                             {"worst", number(at(estimate, "worst_interval_95_mm"), 2)},
                             {"shown", percent(at(estimate, "shown_share"))},
                             {"unknown", percent(unknown)},
                             {"doubtful", is_finite(unknown) && unknown.get<double>() > 0}};
    } else if (is_finite(at(report, "estimated_error_mm")))
        tiles["equations"] = {{"error", number(at(report, "estimated_error_mm"), 3)}};
    return tiles;
}

json alignment_view(const json& alignment) {
    if (!alignment.is_object()) return nullptr;
    json rows = json::array();
    const json& matrix = at(alignment, "matrix");
    if (matrix.is_array())
        for (std::size_t k = 0; k < matrix.size(); ++k) {
            // Either four rows of four or sixteen values.
            if (!matrix[k].is_array() && k % 4 != 0) continue;
            std::vector<std::string> cells;
            for (std::size_t c = 0; c < 4; ++c) {
                const json& list = matrix[k].is_array() ? matrix[k] : matrix;
                const std::size_t at_cell = matrix[k].is_array() ? c : k + c;
                cells.push_back(at_cell < list.size() ? number(list[at_cell], 4) : "–");
            }
            rows.push_back({{"cells", cells}});
        }
    return {{"distance", number(at(alignment, "mean_distance_mm"), 2)}, {"matrix", !rows.empty()}, {"rows", rows}};
}

json materials_view(const json& materials) {
    json rows = json::array();
    if (!materials.is_object()) return rows;
    for (const auto& [label, material] : materials.items())
        rows.push_back({{"label", label},
                        {"name", text(at(material, "name"))},
                        {"law", text(at(material, "law"))},
                        {"youngs", number(at(material, "youngs_modulus_kpa"), 2)},
                        {"poisson", number(at(material, "poissons_ratio"), 3)}});
    return rows;
}

std::string image_line(const json& image) {
    const std::string blocks = number(at(image, "blocks"), 0) + " blocks of the preoperative image were found in it.";
    if (at(image, "matched") == 0) return "Intraoperative image: none of " + blocks;
    return "Intraoperative image: " + number(at(image, "matched"), 0) + " of " + blocks +
           " What was matched last lies " + number(at(image, "residual_mm"), 2) +
           " mm from where the tissue went, in the mean; " + percent(at(image, "shown_share")) +
           " of the organ lies near some of it.";
}

/// A sentence on each kind of data that pulled at the model.
json data_view(const json& report) {
    json lines = json::array();
    if (at(report, "inputs").contains("fixed-labels"))
        lines.push_back("Intraoperative labels: boundaries of the tissue were brought to theirs.");
    if (const json& image = at(report, "image"); image.is_object()) lines.push_back(image_line(image));
    if (const json& surface = at(report, "surface"); surface.is_object())
        lines.push_back("Points of the intraoperative surface: " + percent(at(surface, "inlier_share")) +
                        " of them lie on the model, " + number(at(surface, "residual_mm"), 2) +
                        " mm from it (root mean square); they stand for " + percent(at(surface, "coverage")) +
                        " of its surface.");
    if (const json& points = at(report, "points"); points.is_object())
        lines.push_back("Pairs of points: " + number(at(points, "used"), 0) + " in the model, " +
                        number(at(points, "outliers"), 0) + " of them do not fit, the others by " +
                        number(at(points, "residual_mm"), 2) + " mm (root mean square).");
    if (const json& curves = at(report, "curves"); curves.is_object())
        lines.push_back("Points along vessels: " + percent(at(curves, "inlier_share")) + " of " +
                        number(at(curves, "points"), 0) + " lie on the preoperative lines where these were carried, " +
                        number(at(curves, "residual_mm"), 2) + " mm beside them (root mean square); half of all were " +
                        number(at(curves, "to_lines", "before", "median"), 2) + " mm away or more before, and " +
                        number(at(curves, "to_lines", "after", "median"), 2) + " mm after.");
    if (const json& resected = at(report, "resected"); resected.is_object())
        lines.push_back("Resected tissue: " + number(at(resected, "volume_ml"), 1) +
                        " ml of the preoperative labels are not in the model. The hole of " +
                        number(at(resected, "gap_ml"), 1) +
                        " ml that it leaves is in gap.nii.gz; the displacement means nothing there.");
    return lines;
}

/// A list, and whether there is anything to head a table with.
void put_table(json& view, const std::string& name, json rows) {
    view[name + "_table"] = !rows.empty();
    view[name] = std::move(rows);
}

/// Doubts of reports of schema version 1 are texts alone.
void put_doubts(json& view, const json& doubts) {
    json severe = json::array(), notices = json::array();
    if (doubts.is_array())
        for (const json& doubt : doubts) {
            json& list = at(doubt, "severity") == "notice" ? notices : severe;
            list.push_back({{"text", text(doubt.is_object() ? at(doubt, "text") : doubt)},
                            {"remedy", text(at(doubt, "remedy"))},
                            {"code", text(at(doubt, "code"))}});
        }
    view["no_doubts"] = doubts.is_array() && severe.empty();
    if (!severe.empty()) view["doubtful"] = {{"doubts", severe}};
    if (!notices.empty()) view["noticed"] = {{"notices", notices}};
}

}  // namespace

json view_of(const json& report) {
    json view;
    view["program"] = text(at(report, "program"));
    view["version"] = text(at(report, "version"));
    view["device"] = text(at(report, "device"));
    view["fixed_labels"] = at(report, "inputs").contains("fixed-labels");
    put_table(view, "data", data_view(report));
    put_table(view, "inputs", inputs_view(at(report, "inputs")));
    json parameters = json::array();
    if (at(report, "parameters").is_string())
        view["parameters_text"] = at(report, "parameters");
    else
        flatten(at(report, "parameters"), "", parameters);
    put_table(view, "parameters", std::move(parameters));
    view["stages"] = stages_view(at(report, "stages"));
    put_table(view, "rounds", rounds_view(at(report, "rounds")));
    put_table(view, "overlap", overlap_view(at(report, "overlap")));
    put_table(view, "errors", errors_view(at(report, "target_registration_error")));
    put_table(view, "jacobian", jacobian_view(at(report, "jacobian")));
    view["alignment"] = alignment_view(at(report, "alignment"));
    view["summary"] = summary_view(report);
    if (is_finite(at(report, "peak_memory_mb"))) view["memory"] = number(at(report, "peak_memory_mb"), 0);
    view["started"] = text(at(report, "started"));
    if (is_finite(at(report, "mesh", "nodes")))
        view["mesh_size"] = {{"nodes", number(at(report, "mesh", "nodes"), 0)},
                             {"tetrahedra", number(at(report, "mesh", "tetrahedra"), 0)}};
    put_table(view, "materials", materials_view(at(report, "materials")));
    if (at(report, "notes").is_array() && !at(report, "notes").empty())
        view["notable"] = {{"notes", at(report, "notes")}};
    put_doubts(view, at(report, "doubts"));
    return view;
}

}  // namespace tissuewarp::report::detail
