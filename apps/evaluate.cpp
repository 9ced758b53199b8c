// tissuewarp evaluate: scores label maps, landmarks, curves and displacement fields, whoever made them.

#include "apps/displacement_field.hpp"
#include "apps/inputs.hpp"
#include "apps/noted_images.hpp"
#include "apps/output_folder.hpp"
#include "apps/point_files.hpp"
#include "apps/progress.hpp"
#include "apps/report_json.hpp"
#include "apps/score_sheet.hpp"
#include "apps/verbs.hpp"
#include "core/errors.hpp"
#include "imaging/labels.hpp"
#include "registration/boundary/label_surface.hpp"
#include "registration/io/curves.hpp"
#include "registration/io/surface_points.hpp"

#include <fmt/format.h>

namespace tissuewarp::apps {

namespace {

using namespace registration;
namespace fs = std::filesystem;
using imaging::Volume;

void evaluate_labels(const EvaluateOptions& options, Observer& observer, ScoreSheet& sheet) {
    const imaging::ReadResult labels = imaging::read_labels_with_notes(options.labels);
    for (const std::string& note : notes_of(labels, options.labels)) observer.note(note);
    const imaging::ReadResult references = imaging::read_labels_with_notes(options.reference_labels);
    for (const std::string& note : notes_of(references, options.reference_labels)) observer.note(note);
    require_same_numbers(labels.label_names, options.labels, references.label_names, options.reference_labels);
    Volume reference = references.volume;
    require_same_grid(reference.geometry, labels.volume.geometry, options.reference_labels.string(),
                      options.labels.string(), "resample one onto the other");
    reference.geometry = labels.volume.geometry;
    imaging::LabelNames names;
    if (!options.label_names.empty()) names = imaging::read_label_names(options.label_names);
    names.insert(labels.label_names.begin(), labels.label_names.end());
    sheet.add(overlap(labels.volume, reference), names);
}

Volume read_field(const fs::path& path, Observer& observer) {
    return path.empty() ? Volume{} : read_displacement(path, observer);
}

Volume read_organ(const fs::path& path, Observer& observer) {
    if (path.empty()) return {};
    const Volume labels = read_noted_labels(path, observer);
    require_millimetres(labels.geometry, path);
    imaging::require_labels(labels, {}, path.string().c_str());
    return labels;
}

/// Fixed points of what register takes as --fixed-points: a table of pairs, or a file of points.
Eigen::Matrix3Xd read_data_points(const fs::path& path, Observer& observer) {
    return is_table_of_pairs(path) ? read_landmarks(path, observer).fixed : registration::read_points(path, observer);
}

Eigen::Matrix3Xd read_data(const EvaluateOptions& options, Observer& observer) {
    Eigen::Matrix3Xd data(3, 0);
    const auto append = [&](const Eigen::Matrix3Xd& more) {
        const Eigen::Index before = data.cols();
        data.conservativeResize(3, before + more.cols());
        data.rightCols(more.cols()) = more;
    };
    if (!options.data_surface.empty()) append(read_surface_points(options.data_surface, 1, observer).points);
    if (!options.data_points.empty()) append(read_data_points(options.data_points, observer));
    return data;
}

/// Landmarks, where the field takes them, and how far that is from where they belong.
struct Targets {
    Landmarks landmarks;
    Eigen::Matrix3Xd mapped;
    bool is_mapped;

    [[nodiscard]] BinnedErrors binned(const std::string& coordinate, const std::string& key,
                                      const Eigen::VectorXd& values, const std::vector<double>& edges) const {
        const auto bins = [&](const Eigen::Matrix3Xd& where) {
            return bin_errors((where - landmarks.fixed).colwise().norm().transpose(), values, edges);
        };
        BinnedErrors errors{coordinate, key, bins(landmarks.moving), std::nullopt};
        if (is_mapped) errors.after = bins(mapped);
        return errors;
    }
};

void evaluate_landmarks(const EvaluateOptions& options, const Volume& field, const Volume& organ,
                        std::vector<std::string>& notes, Observer& observer, ScoreSheet& sheet) {
    Targets targets{*read_landmark_files(options.landmarks, observer), {}, !field.empty()};
    const Landmarks& landmarks = targets.landmarks;
    targets.mapped = targets.is_mapped ? displaced(landmarks.moving, field) : landmarks.moving;
    sheet.add(target_error(landmarks, targets.mapped, options.moved), targets.is_mapped);
    if (!organ.empty()) {
        check_inside(landmarks.moving, organ.geometry, "moving landmarks", notes);
        const Eigen::VectorXd depths = depth_below_surface(organ, landmarks.moving);
        const Eigen::Index outside = (depths.array() < 0).count();
        if (10 * outside > depths.size())
            notes.push_back(
                fmt::format("{} of {} moving landmarks lie outside the organ; coordinates must be LPS mm: for "
                            "RAS, negate x and y",
                            outside, depths.size()));
        sheet.add(targets.binned("depth", "by_depth", depths, options.bin_edges));
    }
    const Eigen::Matrix3Xd data = read_data(options, observer);
    if (data.cols() == 0) return;
    const Eigen::VectorXd distances = distance_to_data(landmarks.fixed, data);
    constexpr double farthest_mm = 500;  // larger than an organ
    if (distances.minCoeff() > farthest_mm)
        throw InvalidInput(
            fmt::format("the fixed landmarks lie {:.0f} mm or more from the data; both must be LPS mm of "
                        "the fixed image: for RAS, negate x and y",
                        distances.minCoeff()));
    sheet.add(targets.binned("data at", "by_distance_to_data", distances, options.bin_edges));
}

/// The preoperative lines where the field takes them.
std::vector<Eigen::Matrix3Xd> displaced_lines(const fs::path& path, const Curves& curves, const Volume& field) {
    constexpr double step_mm = 1;  // the field bends what is between two points of a file
    std::vector<Eigen::Matrix3Xd> lines;
    try {
        for (const Eigen::Matrix3Xd& line : curves.moving)
            lines.push_back(displaced(evenly_along(line, step_mm), field));
    } catch (const InvalidInput& problem) {
        throw InvalidInput(fmt::format("{}, every {} mm: {}", path.string(), step_mm, problem.what()));
    }
    return lines;
}

void evaluate_curves(const EvaluateOptions& options, const Volume& field, Observer& observer, ScoreSheet& sheet) {
    constexpr double farthest_mm = 100;
    const Curves curves = read_curves(options.moving_curves, options.fixed_curves, 1, observer);
    const std::vector<std::vector<int>> pieces = read_curve_file(options.fixed_curves).lines;
    CurveErrors errors{curve_residual(curves.moving, curves.fixed, pieces), std::nullopt};
    if (!field.empty())
        errors.after = curve_residual(displaced_lines(options.moving_curves, curves, field), curves.fixed, pieces);
    const double median = (errors.after ? *errors.after : errors.before).to_lines.median;
    if (median > farthest_mm)
        throw InvalidInput(fmt::format(
            "{}: half of the points lie {:.0f} mm or more from the lines of {}; both must be LPS mm, each in "
            "the frame of its image: for RAS, negate x and y",
            options.fixed_curves.string(), median, options.moving_curves.string()));
    sheet.add(errors);
}

void evaluate_field(const EvaluateOptions& options, const Volume& field, Observer& observer, ScoreSheet& sheet) {
    Volume mask;
    if (!options.mask.empty()) {
        mask = read_noted_labels(options.mask, observer);
        require_same_grid(field.geometry, mask.geometry, options.displacement.string(), options.mask.string(),
                          "resample the mask onto the field's grid");
        mask = {field.geometry, cv::Mat(mask.voxels != 0)};
    }
    const Volume* chosen = mask.empty() ? nullptr : &mask;
    sheet.add(field_jacobians(field, chosen));
    if (!options.inverse.empty()) sheet.add(inverse_consistency(field, read_field(options.inverse, observer), chosen));
}

void evaluate_held_out(const EvaluateOptions& options, const Volume& field, const Volume& organ, Observer& observer,
                       ScoreSheet& sheet) {
    const SurfacePoints points = read_surface_points(options.held_out, 1, observer);
    meshing::SurfaceMesh surface = label_surface(organ);
    surface.nodes = displaced(surface.nodes, field);
    sheet.add(surface_residual(surface, points.points));
}

void require_something(const EvaluateOptions& options) {
    if (options.labels.empty() && !options.landmarks.given() && options.displacement.empty() &&
        options.moving_curves.empty())
        throw InvalidInput(
            "nothing to evaluate; give --labels with --reference-labels, --landmarks, --moving-curves with "
            "--fixed-curves, or --displacement");
    if (options.landmarks.given()) return;
    const char* unused = !options.data_surface.empty()  ? "--data-surface"
                         : !options.data_points.empty() ? "--data-points"
                                                        : nullptr;
    if (!options.moving_labels.empty() && options.held_out.empty()) unused = "--moving-labels";
    if (unused) throw InvalidInput(fmt::format("{} sums up landmarks; give --landmarks", unused));
}

}  // namespace

void run_evaluate(const EvaluateOptions& options) {
    ProgressLine progress(options.common);
    require_something(options);
    if (!options.json.empty()) require_could_write_file(options.json);
    progress.begin("evaluating", 0.0, 1.0);
    ScoreSheet sheet;
    std::vector<std::string> notes;
    if (!options.labels.empty()) evaluate_labels(options, progress, sheet);
    const Volume field = read_field(options.displacement, progress),
                 organ = read_organ(options.moving_labels, progress);
    if (options.landmarks.given()) evaluate_landmarks(options, field, organ, notes, progress, sheet);
    if (!options.moving_curves.empty()) evaluate_curves(options, field, progress, sheet);
    if (!field.empty()) evaluate_field(options, field, progress, sheet);
    if (!options.held_out.empty()) evaluate_held_out(options, field, organ, progress, sheet);
    notes.insert(notes.begin(), progress.notes().begin(), progress.notes().end());
    sheet.add_notes(notes);
    if (!options.json.empty()) write_json(sheet.json(), options.json);
    progress.clear();
    if (!options.common.quiet) fmt::print("{}", sheet.text());
}

}  // namespace tissuewarp::apps
