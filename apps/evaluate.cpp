// tissuewarp evaluate: scores label maps, landmarks and a displacement field, whoever made them.

#include "registration/evaluation.hpp"

#include "apps/inputs.hpp"
#include "apps/output_folder.hpp"
#include "apps/point_files.hpp"
#include "apps/progress.hpp"
#include "apps/report_json.hpp"
#include "apps/verbs.hpp"
#include "core/errors.hpp"

#include <fmt/format.h>

namespace tissuewarp::apps {

namespace {

using nlohmann::json;
using namespace registration;

void evaluate_labels(const EvaluateOptions& options, json& report, std::string& text) {
    const imaging::Volume labels = imaging::read_labels(options.labels);
    imaging::Volume reference = imaging::read_labels(options.reference_labels);
    require_same_grid(reference.geometry, labels.geometry, options.reference_labels.string(), options.labels.string(),
                      "resample one onto the other");
    reference.geometry = labels.geometry;
    const auto overlaps = overlap(labels, reference);
    report["overlap"] = to_json(overlaps);
    text += fmt::format("{:<16}{:>8}{:>12}{:>12}\n", "overlap", "Dice", "HD95 (mm)", "mean (mm)");
    for (const auto& [label, o] : overlaps)
        text += fmt::format("  {:<14}{:>8.4f}{:>12.3f}{:>12.3f}\n",
                            label == 0 ? "all labels" : fmt::format("label {}", label), o.dice, o.hausdorff_95_mm,
                            o.mean_surface_distance_mm);
}

void evaluate_landmarks(const EvaluateOptions& options, const imaging::Volume& field, json& report, std::string& text) {
    const Landmarks landmarks = *read_landmark_files(options.landmarks);
    const Eigen::Matrix3Xd mapped = field.empty() ? landmarks.moving : displaced(landmarks.moving, field);
    const TargetError error = target_error(landmarks, mapped, options.moved);
    json& errors = report["target_registration_error"] = to_json(error);
    if (field.empty())  // nothing was mapped
        for (const char* which : {"all", "moved"}) errors[which].erase("after");
    text +=
        fmt::format("{:<24}{:>6}{:>8}{:>8}{:>8}{:>8}\n", "target error (mm)", "count", "mean", "median", "95th", "max");
    const auto row = [&](const std::string& name, const Summary& s) {
        text += fmt::format("  {:<22}{:>6}{:>8.3f}{:>8.3f}{:>8.3f}{:>8.3f}\n", name, s.count, s.mean, s.median,
                            s.percentile_95, s.maximum);
    };
    row("before", error.before);
    if (!field.empty()) row("after", error.after);
    row(fmt::format("moved > {:g} mm, before", options.moved), error.moved_before);
    if (!field.empty()) row(fmt::format("moved > {:g} mm, after", options.moved), error.moved_after);
}

void evaluate_field(const EvaluateOptions& options, const imaging::Volume& field, json& report, std::string& text) {
    imaging::Volume mask;
    if (!options.mask.empty()) {
        mask = imaging::read_labels(options.mask);
        require_same_grid(field.geometry, mask.geometry, options.displacement.string(), options.mask.string(),
                          "resample the mask onto the field's grid");
        mask = {field.geometry, cv::Mat(mask.voxels != 0)};
    }
    const JacobianReport jacobian = field_jacobians(field, mask.empty() ? nullptr : &mask);
    report["jacobian"] = to_json(jacobian);
    text += fmt::format(
        "det J: minimum {:.4f}, 1st percentile {:.4f}, median {:.4f}, 99th {:.4f}, maximum {:.4f}; folded {}\n",
        jacobian.minimum, jacobian.percentile_1, jacobian.median, jacobian.percentile_99, jacobian.maximum,
        jacobian.folded);
}

}  // namespace

void run_evaluate(const EvaluateOptions& options) {
    ProgressLine progress(options.common.quiet);
    if (options.labels.empty() && !options.landmarks.given() && options.displacement.empty())
        throw InvalidInput(
            "nothing to evaluate; give --labels with --reference-labels, --landmarks, or --displacement");
    json report{{"schema", "tissuewarp.evaluation"}, {"schema_version", 1}};
    std::string text;
    if (!options.json.empty()) require_could_write_file(options.json);
    progress.begin("evaluating", 0.0, 1.0);
    if (!options.labels.empty()) evaluate_labels(options, report, text);
    imaging::Volume field;
    if (!options.displacement.empty()) {
        field = imaging::read_volume(options.displacement);
        if (field.channels() != 3)
            throw InvalidInput(fmt::format("'{}' has {} components; give a displacement field of three",
                                           options.displacement.string(), field.channels()));
        field = field.as(CV_32F);
    }
    if (options.landmarks.given()) evaluate_landmarks(options, field, report, text);
    if (!field.empty()) evaluate_field(options, field, report, text);
    if (!options.json.empty()) write_json(report, options.json);
    progress.clear();
    if (!options.common.quiet) fmt::print("{}", text);
}

}  // namespace tissuewarp::apps
