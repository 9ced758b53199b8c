#include "study/page.hpp"

#include "core/atomic_file.hpp"
#include "report/detail/template.hpp"
#include "study/detail/figures.hpp"

#include <algorithm>
#include <cstdio>

namespace tissuewarp::study {

namespace detail {
const char* page_template();  // page.html, embedded at build time
}

namespace {

using nlohmann::json;

std::string perhaps(const std::optional<double>& millimetres) {
    return millimetres ? mm_text(*millimetres) : "–";
}

std::string ratio_text(double ratio) {
    char text[32];
    std::snprintf(text, sizeof text, ratio < 0.1 ? "%.3f" : "%.2f", ratio);
    return text;
}

json tile_of(const char* what, const Point* point) {
    if (point == nullptr) return {};
    return {{"what", what},
            {"error", mm_text(point->error_mm())},
            {"seconds", seconds_text(point->median_seconds())},
            {"preparation", seconds_text(point->preparation_seconds())},
            {"words", words_of(point->setting)}};
}

json row_of(const Point& point) {
    json row{{"words", words_of(point.setting)},
             {"elements", point.elements},
             {"error", mm_text(point.error_mm())},
             {"algebraic", perhaps(point.algebraic_mm)},
             {"seconds", seconds_text(point.median_seconds())},
             {"worst", seconds_text(point.percentile_95_seconds())},
             {"preparation", seconds_text(point.preparation_seconds())},
             {"evaluations", point.force_evaluations}};
    row["numerical"] = perhaps(point.numerical ? std::optional(point.numerical->rms) : std::nullopt);
    row["model"] = perhaps(point.model ? std::optional(point.model->rms) : std::nullopt);
    row["percentile_95"] = perhaps(point.target ? std::optional(point.target->percentile_95) : std::nullopt);
    return row;
}

json comparisons_of(const Findings& findings) {
    json rows = json::array();
    for (const Comparison& comparison : findings.comparisons) {
        json row = row_of(*comparison.point);
        row["factor"] = comparison.factor;
        row["value"] = comparison.value;
        row["error_ratio"] = ratio_text(comparison.error_ratio);
        row["time_ratio"] = ratio_text(comparison.time_ratio);
        row["verdict"] = comparison.verdict;
        row["pays"] = comparison.verdict.ends_with(": pays");
        row["does_not_pay"] = comparison.verdict.ends_with(": does not pay");
        rows.push_back(row);
    }
    return rows;
}

/// Stages of the base: name, phase, median and 95th percentile.
json stages_of(const Point* base) {
    json rows = json::array();
    if (base == nullptr) return rows;
    for (const Stage& stage : base->stages)
        rows.push_back({{"name", stage.name},
                        {"phase", stage.phase == Phase::Preparation ? "before" : "during"},
                        {"median", seconds_text(percentile(stage.seconds, 0.5))},
                        {"worst", seconds_text(percentile(stage.seconds, 0.95))}});
    return rows;
}

std::string file_name(const std::string& problem, const char* figure) {
    std::string name = problem + "-" + figure + ".svg";
    std::replace(name.begin(), name.end(), ':', '-');
    return name;
}

json problem_values(const ProblemSummary& problem, const std::vector<Point>& points,
                    const std::filesystem::path& folder) {
    const Findings findings = findings_of(problem, points);
    json values{{"name", problem.name},
                {"story", problem.story},
                {"registration", problem.registration},
                {"failures", findings.failures},
                {"solved", !findings.solved.empty()}};
    if (findings.solved.empty()) return values;
    const std::string front = detail::front_figure(problem, findings), grid = detail::grid_figure(problem, findings);
    write_file(front, folder / file_name(problem.name, "front"));
    if (!grid.empty()) write_file(grid, folder / file_name(problem.name, "grid"));
    values["front"] = front;
    values["grid"] = grid;
    values["tiles"] = json::array();
    for (const auto& [what, point] : {std::pair{"base", findings.base}, std::pair{"most accurate", findings.best},
                                      std::pair{"knee: within 5 % of that", findings.knee}})
        if (point != nullptr) values["tiles"].push_back(tile_of(what, point));
    if (findings.best->reference_mm) values["reference"] = mm_text(*findings.best->reference_mm);
    if (findings.best->target) values["before"] = mm_text(findings.best->target->before);
    values["comparisons"] = comparisons_of(findings);
    values["stages"] = stages_of(findings.base);
    values["points"] = json::array();
    for (const Point* point : findings.solved) values["points"].push_back(row_of(*point));
    return values;
}

}  // namespace

void write_page(const std::vector<ProblemSummary>& problems, const std::vector<Point>& points,
                const Provenance& provenance, const std::filesystem::path& folder) {
    json values{{"problems", json::array()}, {"provenance", json::array()}};
    for (const ProblemSummary& problem : problems)
        values["problems"].push_back(problem_values(problem, points, folder));
    for (const auto& [name, value] : provenance) values["provenance"].push_back({{"name", name}, {"value", value}});
    write_file(report::detail::fill(detail::page_template(), values), folder / "accuracy-time.html");
}

}  // namespace tissuewarp::study
