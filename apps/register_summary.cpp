#include "apps/register_summary.hpp"

#include "apps/output_names.hpp"
#include "imaging/labels.hpp"
#include "registration/evaluation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tissuewarp::apps {

namespace {

std::string summary_row(const std::string& name, const registration::Summary& s) {
    return fmt::format("  {:<22}{:>6}{:>8.2f}{:>8.2f}{:>8.2f}{:>8.2f}\n", name, s.count, s.mean, s.median,
                       s.percentile_95, s.maximum);
}

std::string estimate_text(const registration::UncertaintySummary& s) {
    if (!std::isfinite(s.deviation_mm)) return "estimated error: none could be made of these data\n";
    const std::string of_mesh =
        std::isfinite(s.discretisation_mm) ? fmt::format("{:.2f}", s.discretisation_mm) : "not estimated";
    std::string text = fmt::format(
        "estimated error (1 σ): {:.2f} mm over the tissue, of the mesh {}, the solver {:.3f}, the data {:.2f}; "
        "95 % within {:.2f} mm, where least is known within {:.2f} mm\n",
        s.deviation_mm, of_mesh, s.algebraic_mm, s.data_mm, s.interval_mm, s.worst_interval_mm);
    return text + fmt::format(
                      "shown by the data: {:.0f} % of the tissue, carried there by mechanics: {:.0f} %, not known "
                      "to 5 mm: {:.0f} %\n",
                      100 * s.shown_share, std::max(0.0, 100 * (1 - s.shown_share - s.unknown_share)),
                      100 * s.unknown_share);
}

std::string resected_text(const RegistrationRun& run) {
    if (run.prepared->resected.empty()) return "resected: nothing was found to be\n";
    return fmt::format("resected: {:.1f} ml of labels {}; the hole of {:.1f} ml is in {}\n",
                       imaging::millilitres(run.prepared->resected), fmt::join(run.prepared->options.resected, ", "),
                       imaging::millilitres(run.products.gap), gap_name);
}

std::string distances_text(const Scores& scores) {
    std::string text;
    if (const auto& error = scores.target_error) {
        text += "target error (mm)        count    mean  median    95th     max\n";
        text += summary_row("before", error->before) + summary_row("after", error->after);
        const std::string moved = fmt::format("moved > {:g} mm, ", error->moved_mm);
        text += summary_row(moved + "before", error->moved_before) + summary_row(moved + "after", error->moved_after);
    }
    if (const auto& curves = scores.curves) {
        text += "curves to lines (mm)     count    mean  median    95th     max\n";
        text += summary_row("before", curves->before) + summary_row("after", curves->after);
    }
    return text;
}

std::string body_text(const registration::BodyMotion& body, const Eigen::Isometry3d& placement,
                      const imaging::LabelNames& names) {
    const Eigen::Isometry3d beside = placement.inverse() * body.motion;
    return fmt::format(
        "rigid neighbour {} moved on its own: turned by {:.1f}° against the organ; boundaries {:.2f} mm "
        "apart\n",
        imaging::label_title(body.label, names), Eigen::AngleAxisd(beside.linear()).angle() * 180 / EIGEN_PI,
        body.apart_mm);
}

/// How well each kind of data is met.
std::string fits_text(const RegistrationRun& run) {
    std::string text;
    for (std::size_t n = 0; n < run.result.images.size(); ++n) {
        const registration::ImageFit& fit = run.result.images[n];
        const std::string name = n == 0 ? "image" : fmt::format("contrast {}", n + 1);
        if (fit.matched == 0)
            text += fmt::format("{}: none of {} blocks found\n", name, fit.blocks);
        else
            text += fmt::format("{}: {} of {} blocks found, {:.2f} mm from the tissue; near {:.0f} % of the organ\n",
                                name, fit.matched, fit.blocks, fit.residual_mm, 100 * fit.shown_share);
    }
    if (const auto& fit = run.result.surface)
        text += fmt::format("surface points: {:.0f} % on the model, {:.2f} mm from it (root mean square)\n",
                            100 * fit->inlier_share, fit->residual_mm);
    if (const auto& fit = run.result.points)
        text += fmt::format("paired points: {} of {} fit, {:.2f} mm off (root mean square)\n",
                            fit->used - fit->outliers, fit->used, fit->residual_mm);
    if (const auto& fit = run.result.curves)
        text += fmt::format("points along vessels: {:.0f} % of {} on the curves, {:.2f} mm across (root mean square)\n",
                            100 * fit->inlier_share, fit->points, fit->residual_mm);
    if (const auto& fit = run.result.contact)
        text += fmt::format("rigid neighbours: {} surface nodes touch, at most {:.2f} mm deep\n", fit->touching,
                            fit->deepest_mm);
    for (const registration::BodyMotion& body : run.result.bodies)
        if (body.own) text += body_text(body, run.result.deformation.placement, run.inputs.label_names);
    if (const auto& fit = run.result.anchors)
        text += fmt::format("anchors: {} nodes, moved by at most {:.2f} mm\n", fit->nodes, fit->largest_mm);
    return text;
}

std::string overlap_text(const RegistrationRun& run) {
    std::string text;
    if (!run.scores.after.empty()) text += "Dice                      before   after\n";
    for (const auto& [label, after] : run.scores.after)
        text += fmt::format("  {:<22}{:>8.3f}{:>8.3f}\n",
                            label == 0 ? "all labels" : imaging::label_title(label, run.inputs.label_names),
                            run.scores.before.contains(label) ? run.scores.before.at(label).dice : 0.0, after.dice);
    return text;
}

std::string notes_text(const RegistrationRun& run) {
    std::string text;
    for (const std::vector<std::string>* notes : {&run.inputs.notes, &run.notes})
        for (const std::string& note : *notes)
            if (!run.dial || note != run.dial->reason) text += "note: " + note + "\n";  // said above
    for (const registration::Doubt& doubt : run.result.doubts)
        text += fmt::format("{}: {}\n", name_of(doubt.severity), full_text(doubt));
    if (!run.result.doubts.empty()) text += "what doubts mean: docs/manual/doubts.md\n";
    return text;
}

}  // namespace

std::string summary_text(const RegistrationRun& run, double total_seconds) {
    std::string text = "stage                  seconds\n";
    for (const auto& [stage, seconds] : run.times) text += fmt::format("  {:<20}{:>8.2f}\n", stage, seconds);
    text += fmt::format("  {:<20}{:>8.2f}\n", "total", total_seconds);
    text += distances_text(run.scores);
    text += fits_text(run);
    if (!run.products.gap.empty()) text += resected_text(run);
    text += fmt::format("from data at hand to warped image: {:.2f} s\n", run.intraoperative_seconds);
    if (run.dial) text += "chosen: " + run.dial->reason + "\n";
    if (const auto& error = run.products.uncertainty) text += estimate_text(registration::summarise(*error));
    text += overlap_text(run);
    text +=
        fmt::format("det J of the mesh: minimum {:.3f}, folded {}\n", run.scores.mesh.minimum, run.scores.mesh.folded);
    text += notes_text(run);
    return text + "results in " + run.options.output.string() + "\n";
}

}  // namespace tissuewarp::apps
