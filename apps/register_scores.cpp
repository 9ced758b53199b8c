#include "apps/register_scores.hpp"

#include "apps/register_maps.hpp"
#include "core/errors.hpp"
#include "imaging/filters.hpp"
#include "imaging/labels.hpp"
#include "registration/evaluation/curve_residual.hpp"
#include "registration/field.hpp"
#include "registration/io/curves.hpp"
#include "registration/resection/gap.hpp"

#include <fmt/format.h>
#include <tbb/parallel_invoke.h>

namespace tissuewarp::apps {

using namespace registration;

namespace {

CurveDistances curve_distances(const RegistrationRun& run) {
    constexpr double step_mm = 1;  // tissue bends what is between two points of a file
    const Curves& curves = *run.inputs.curves;
    const PointTransform transform(run.result.deformation, {run.options.fade});
    std::vector<Eigen::Matrix3Xd> carried;
    for (const Eigen::Matrix3Xd& line : curves.moving) carried.push_back(transform(evenly_along(line, step_mm)));
    return {curve_residual(curves.moving, curves.fixed, {}).to_lines,
            curve_residual(carried, curves.fixed, {}).to_lines};
}

/// Of the organ; fixed labels of bones alone say nothing of it.
void score_overlap(RegistrationRun& run) {
    if (run.inputs.fixed_labels.empty()) return;
    const auto organ = [&](const imaging::Volume& labels) { return organ_of(labels, run.options); };
    const imaging::Volume fixed = organ(run.inputs.fixed_labels);
    if (imaging::labels_in(fixed).empty()) return;
    Scores& scores = run.scores;
    tbb::parallel_invoke(
        [&] {
            const imaging::Volume moving = organ(run.inputs.moving_labels);
            scores.before = overlap(imaging::resample(moving, fixed.geometry, imaging::Interpolation::Nearest), fixed);
        },
        [&] { scores.after = overlap(organ(run.products.warped_labels), fixed); });
}

}  // namespace

void estimate_errors(RegistrationRun& run, ProgressLine& progress) {
    Products& products = run.products;
    products.uncertainty = run.stretched ? uncertainty(*run.stretched, {}, progress)
                                         : uncertainty(*run.prepared, run.result, {}, progress);
    products.uncertainty_volumes =
        uncertainty_on_grid(*products.uncertainty, run.result.deformation, products.fixed_to_moving.geometry);
    for (Doubt& doubt : doubts_of(*products.uncertainty, run.options.tolerance))
        run.result.doubts.push_back(std::move(doubt));
}

void score_warped(RegistrationRun& run) {
    Scores& scores = run.scores;
    score_overlap(run);
    scores.mesh = mesh_jacobians(run.result.deformation);
    if (run.inputs.landmarks) scores.target_error = target_error(*run.inputs.landmarks, run.products.landmarks);
    if (run.inputs.curves) scores.curves = curve_distances(run);
}

void score_forward_field(RegistrationRun& run) {
    const imaging::Volume organ = imaging::mask_of_all(organ_of(run.inputs.moving_labels, run.options));
    const imaging::Volume determinant = jacobian_determinant(run.products.moving_to_fixed);
    run.scores.organ = jacobian_report(determinant, &organ);
    run.scores.grid = jacobian_report(determinant);
}

void doubt_scores(RegistrationRun& run) {
    std::vector<Doubt>& doubts = run.result.doubts;
    if (auto doubt = doubt_of_folds(run.scores.grid, run.scores.organ, run.products.unfolded_back))
        doubts.push_back(std::move(*doubt));
    if (auto doubt = doubt_of_unfolding(run.products.unfolded_forth, run.products.unfolded_back))
        doubts.push_back(std::move(*doubt));
    if (!run.products.gap.empty() && !run.inputs.fixed_labels.empty())
        if (auto doubt = doubt_of_gap(run.products.gap, run.inputs.fixed_labels)) doubts.push_back(std::move(*doubt));
    if (!run.resection) return;
    for (Doubt& doubt : doubts_of(*run.resection, run.result.deformation, run.products.gap))
        doubts.push_back(std::move(doubt));
}

std::string codes(const std::vector<Doubt>& doubts) {
    std::vector<std::string> result;
    for (const Doubt& doubt : doubts) result.push_back(doubt.code);
    return result.empty() ? "none" : fmt::format("{}", fmt::join(result, ", "));
}

void require_no_doubts(const RegistrationRun& run) {
    std::vector<std::string> codes;
    for (const Doubt& doubt : run.result.doubts)
        if (doubt.severity == Severity::Doubt) codes.push_back(doubt.code);
    if (codes.empty()) return;
    throw SolverFailure(fmt::format(
        "the result is doubted ({}); '{}' says why, docs/manual/doubts.md what it means; all files are written",
        fmt::join(codes, ", "), (run.options.output / "report.json").string()));
}

}  // namespace tissuewarp::apps
