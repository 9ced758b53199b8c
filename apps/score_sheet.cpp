#include "apps/score_sheet.hpp"

#include "apps/report_json.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tissuewarp::apps {

namespace {

using registration::ErrorBin;
using registration::Summary;

std::string name_of(const ErrorBin& bin) {
    if (std::isinf(bin.from)) return "outside the organ";
    return std::isinf(bin.to) ? fmt::format("≥ {:g} mm", bin.from) : fmt::format("{:g}–{:g} mm", bin.from, bin.to);
}

nlohmann::json bound(double mm) {
    return std::isfinite(mm) ? nlohmann::json(mm) : nlohmann::json(nullptr);
}

}  // namespace

void ScoreSheet::heading(const std::string& name) {
    text_ += fmt::format("{:<32}{:>8}{:>9}{:>9}{:>9}{:>9}\n", name, "count", "mean", "median", "95th", "max");
}

void ScoreSheet::row(const std::string& name, const Summary& s) {
    if (s.count == 0)
        text_ += fmt::format("  {:<30}{:>8}{:>9}{:>9}{:>9}{:>9}\n", name, 0, "–", "–", "–", "–");
    else
        text_ += fmt::format("  {:<30}{:>8}{:>9.3f}{:>9.3f}{:>9.3f}{:>9.3f}\n", name, s.count, s.mean, s.median,
                             s.percentile_95, s.maximum);
}

void ScoreSheet::add(const std::map<int, registration::Overlap>& overlaps, const imaging::LabelNames& names) {
    json_["overlap"] = to_json(overlaps, names);
    const auto title = [&](int label) { return label == 0 ? "all labels" : imaging::label_title(label, names); };
    std::size_t width = 14;
    for (const auto& [label, o] : overlaps) width = std::max(width, title(label).size());
    text_ += fmt::format("{:<{}}{:>8}{:>12}{:>12}\n", "overlap", width + 2, "Dice", "HD95 (mm)", "mean (mm)");
    for (const auto& [label, o] : overlaps)
        text_ += fmt::format("  {:<{}}{:>8.4f}{:>12.3f}{:>12.3f}\n", title(label), width, o.dice, o.hausdorff_95_mm,
                             o.mean_surface_distance_mm);
}

void ScoreSheet::add(const registration::TargetError& error, bool mapped) {
    nlohmann::json& errors = json_["target_registration_error"] = to_json(error);
    if (!mapped)
        for (const char* which : {"all", "moved"}) errors[which].erase("after");
    heading("target error (mm)");
    row("before", error.before);
    if (mapped) row("after", error.after);
    row(fmt::format("moved > {:g} mm, before", error.moved_mm), error.moved_before);
    if (mapped) row(fmt::format("moved > {:g} mm, after", error.moved_mm), error.moved_after);
}

void ScoreSheet::add(const BinnedErrors& errors) {
    nlohmann::json& bins = json_["target_registration_error"][errors.key] = nlohmann::json::array();
    for (std::size_t b = 0; b < errors.before.size(); ++b) {
        const ErrorBin& bin = errors.before[b];
        bins.push_back({{"from_mm", bound(bin.from)}, {"to_mm", bound(bin.to)}, {"before", to_json(bin.error)}});
        const ErrorBin& shown = errors.after ? (*errors.after)[b] : bin;
        if (errors.after) bins.back()["after"] = to_json(shown.error);
        row(fmt::format("{} {}", errors.coordinate, name_of(shown)), shown.error);
    }
}

void ScoreSheet::add(const registration::JacobianReport& j) {
    json_["jacobian"] = to_json(j);
    text_ += fmt::format("{:<10}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}\n", "det J", "min", "1st", "5th", "median",
                         "95th", "99th", "max", "≤ 0");
    text_ += fmt::format("{:<10}{:>9.4f}{:>9.4f}{:>9.4f}{:>9.4f}{:>9.4f}{:>9.4f}{:>9.4f}{:>8.3g}%\n", "", j.minimum,
                         j.percentile_1, j.percentile_5, j.median, j.percentile_95, j.percentile_99, j.maximum,
                         100 * j.folded_share);
    text_ += fmt::format("  folded: {} voxels, {:g} mm³\n", j.folded, j.folded_mm3);
}

void ScoreSheet::add(const registration::InverseConsistency& consistency) {
    json_["inverse_consistency"] = {{"error_mm", to_json(consistency.error)}, {"left_the_grid", consistency.left}};
    heading("inverse consistency (mm)");
    row("there and back", consistency.error);
    if (consistency.left > 0) text_ += fmt::format("  {} voxels leave the grid of the inverse\n", consistency.left);
}

void ScoreSheet::add(const registration::SurfaceResidual& residual) {
    json_["held_out_surface"] = {{"distance_mm", to_json(residual.distance)},
                                 {"mean_signed_mm", residual.mean_signed_mm}};
    heading("held-out surface (mm)");
    row("distance", residual.distance);
    text_ += fmt::format("  {:<30}{:>8}{:>9.3f}\n", "signed, outward positive", "", residual.mean_signed_mm);
}

void ScoreSheet::add(const CurveErrors& errors) {
    nlohmann::json& curves = json_["curves"] = nlohmann::json::object();
    heading("curves (mm)");
    const auto add = [&](const std::string& when, const registration::CurveResidual& residual) {
        curves["to_lines"][when] = to_json(residual.to_lines);
        row("points to lines, " + when, residual.to_lines);
        if (residual.from_lines.count == 0) return;
        curves["from_lines"][when] = to_json(residual.from_lines);
        curves["shown_mm"][when] = residual.shown_mm;
        row("lines to points, " + when, residual.from_lines);
    };
    add("before", errors.before);
    if (errors.after) add("after", *errors.after);
}

void ScoreSheet::add_notes(const std::vector<std::string>& notes) {
    if (notes.empty()) return;
    json_["notes"] = notes;
    for (const std::string& note : notes) text_ += "note: " + note + "\n";
}

}  // namespace tissuewarp::apps
