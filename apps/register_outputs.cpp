#include "apps/register_outputs.hpp"

#include "apps/bids.hpp"
#include "apps/output_names.hpp"
#include "apps/point_files.hpp"
#include "apps/progress.hpp"
#include "apps/register_dicom.hpp"
#include "apps/register_maps.hpp"
#include "apps/report_json.hpp"
#include "apps/versions.hpp"
#include "core/atomic_file.hpp"
#include "imaging/labels.hpp"
#include "meshing/mesh_io.hpp"
#include "registration/field.hpp"
#include "registration/io/transform_file.hpp"
#include "registration/record.hpp"
#include "report/page.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

namespace tissuewarp::apps {

namespace {

using registration::Deformation;
using registration::write_itk_transform;

constexpr double jacobian_step = 1.0 / 8192;  ///< a whole power of two halves the file (imaging::displacement_step_mm)

/// The smallest integer type that holds the labels, as other programs write them.
imaging::Volume compact(const imaging::Volume& labels) {
    double most = 0;
    const auto* values = labels.data<std::int32_t>();
    for (long long v = 0; v < labels.geometry.voxel_count(); ++v) most = std::max(most, double(values[v]));
    if (most <= 255) return labels.as(CV_8U);
    return most <= 32767 ? labels.as(CV_16S) : labels;
}

void write_mesh(const Deformation& deformation, const std::filesystem::path& path) {
    const Eigen::VectorXd rest = meshing::tet_volumes(deformation.mesh);
    const Eigen::VectorXd deformed = meshing::tet_volumes(deformation.deformed_mesh());
    const meshing::MeshArray elastic{"displacement", deformation.displacement};
    const meshing::MeshArray total{"total_displacement", deformation.deformed_nodes() - deformation.mesh.nodes};
    const meshing::MeshArray jacobian{"J", deformed.cwiseQuotient(rest).transpose()};
    meshing::write_vtu(deformation.mesh, path, {elastic, total}, {jacobian});
}

/// What is estimated of places of the moving frame; NaN outside the tissue, where nothing is said.
void append_estimates(std::vector<Column>& columns, const RegistrationRun& run, const Eigen::Matrix3Xd& places) {
    if (!run.products.uncertainty) return;
    const auto estimates = run.products.uncertainty->at(places);
    const auto column = [&](const char* name, auto value) {
        Eigen::VectorXd values(places.cols());
        for (Eigen::Index p = 0; p < values.size(); ++p) {
            const auto& estimate = estimates[static_cast<std::size_t>(p)];
            values[p] = estimate ? double(value(*estimate)) : std::numeric_limits<double>::quiet_NaN();
        }
        columns.push_back({name, values});
    };
    column("algebraic_mm", [](const auto& e) { return e.algebraic_mm; });
    column("discretisation_mm", [](const auto& e) { return e.discretisation_mm; });
    column("data_mm", [](const auto& e) { return e.data_mm; });
    column("deviation_mm", [](const auto& e) { return e.deviation_mm; });
    column("interval_95_mm", [](const auto& e) { return e.interval_mm; });
    column("trust", [](const auto& e) { return static_cast<int>(e.trust); });
}

void write_landmarks(const RegistrationRun& run, const std::filesystem::path& path) {
    const registration::Landmarks& landmarks = *run.inputs.landmarks;
    std::vector<Column> columns;
    append_points(columns, "pre_", landmarks.moving);
    append_points(columns, "warped_", run.products.landmarks);
    append_points(columns, "intra_", landmarks.fixed);
    columns.push_back({"before_mm", (landmarks.moving - landmarks.fixed).colwise().norm()});
    columns.push_back({"after_mm", (run.products.landmarks - landmarks.fixed).colwise().norm()});
    append_estimates(columns, run, landmarks.moving);
    write_columns(columns, path);
}

void write_points(const RegistrationRun& run, const std::filesystem::path& path) {
    std::vector<Column> columns;
    append_points(columns, "", run.products.points);
    append_estimates(columns, run, *run.inputs.points);
    write_columns(columns, path);
}

registration::RecordInfo record_info(const RegistrationRun& run) {
    registration::RecordInfo info;
    info.parameters_toml = to_toml(run.options.parameters);
    info.provenance = {{"started", run.started}, {"device", run.result.engine}};
    for (const auto& [name, version] : versions()) info.provenance["version " + name] = version;
    for (const InputFile& file : run.inputs.files) {
        info.provenance["input " + file.role] = file.path.string();
        if (!file.sha256.empty()) info.provenance["sha256 " + file.role] = file.sha256;
    }
    return info;
}

std::string summary_row(const std::string& name, const registration::Summary& s) {
    return fmt::format("  {:<22}{:>6}{:>8.2f}{:>8.2f}{:>8.2f}{:>8.2f}\n", name, s.count, s.mean, s.median,
                       s.percentile_95, s.maximum);
}

std::string estimate_text(const registration::UncertaintySummary& s) {
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

/// Puts files into the output folder, under the names that they have there. Copies write for the same run.
class Writer {
public:
    Writer(const RegistrationRun& run, const OutputFolder& output, tbb::task_group& tasks)
        : run_(&run), output_(&output), tasks_(&tasks) {}

    [[nodiscard]] const RegistrationRun& run() const { return *run_; }

    template <class Write>
    void now(const std::string& name, const Write& write) const {
        if (interrupted()) throw Cancelled();
        const std::string in_folder = bids_name(run_->options, name);
        const std::filesystem::path path = output_->path(in_folder);
        try {
            write(path);
            if (in_folder != name) write_file(sidecar(run_->options, name), output_->path(sidecar_name(in_folder)));
        } catch (const IoError& error) {
            throw IoError(output_->in_words(error.what()));
        }
    }
    /// In a task of its own.
    template <class Write>
    void start(const std::string& name, const Write& write) const {
        tasks_->run([writer = *this, name, write] { writer.now(name, write); });
    }

private:
    const RegistrationRun* run_;
    const OutputFolder* output_;
    tbb::task_group* tasks_;
};

/// Before other files, which could fill the disk meanwhile (transform_file.cpp).
void write_transforms(const Writer& writer) {
    const Products& products = writer.run().products;
    const Eigen::Isometry3d& rigid = writer.run().result.deformation.far_motion();
    writer.now(transform_name,
               [&](auto& path) { write_itk_transform(products.fixed_to_moving, rigid.inverse(), path); });
    if (writes(writer.run().options, inverse_transform))
        writer.now(inverse_transform.file,
                   [&](auto& path) { write_itk_transform(products.moving_to_fixed, rigid, path); });
}

/// What a file that --write names is made of.
enum class Part { Warped, Forward, Estimates };

Part part_of(const OptionalOutput& output) {
    const std::string word = output.word;
    if (word == "displacement_magnitude") return Part::Warped;
    return word == "jacobian" ? Part::Forward : Part::Estimates;
}

void start_optional(const Writer& writer, Part part) {
    const RegistrationRun& run = writer.run();
    const Products& products = run.products;
    for (const OptionalOutput& output : optional_outputs) {
        if (!writes(run.options, output) || part_of(output) != part) continue;
        const std::string word = output.word, file = output.file;
        if (word == "displacement_magnitude")
            writer.start(file, [&](auto& path) {
                write_volume(rounded(magnitude(products.fixed_to_moving), imaging::displacement_step_mm), path);
            });
        else if (word == "jacobian")
            writer.start(file, [&](auto& path) {
                write_volume(rounded(registration::jacobian_determinant(products.moving_to_fixed), jacobian_step),
                             path);
            });
        else if (word == "organ")
            writer.start(file, [&](auto& path) { write_organ(run, path); });
        else if (word == "dicom")
            writer.start(file, [&run, file](auto& path) { write_dicom_result(run, file, path); });
        else if (file.starts_with("warped_landmarks"))
            writer.start(file, [&](auto& path) { write_landmark_markups(run, path); });
        else if (file.starts_with("warped_points"))
            writer.start(file, [&](auto& path) { write_point_markups(run, path); });
    }
}

}  // namespace

void start_writing_warped(const RegistrationRun& run, const OutputFolder& output, tbb::task_group& tasks) {
    const Writer writer(run, output, tasks);
    tasks.run([writer, &run] {
        const Products& products = run.products;
        write_transforms(writer);
        writer.start(fixed_to_moving_name, [&](auto& path) {
            write_displacement_field(products.fixed_to_moving, path, imaging::FieldType::Resampling);
        });
        if (!products.warped.empty())
            writer.start("warped.nii.gz", [&](auto& path) { write_volume(products.warped, path); });
        writer.start("warped_labels.nii.gz", [&](auto& path) { write_volume(compact(products.warped_labels), path); });
        if (writes_cavity(run.options))
            writer.start(cavity_name, [&](auto& path) { write_volume(run.resection->cavity, path); });
        writer.start("mesh.vtu", [&](auto& path) { write_mesh(run.result.deformation, path); });
        if (products.surface)
            writer.start(surface_name(run.options),
                         [&](auto& path) { meshing::write_surface(*products.surface, path); });
        start_optional(writer, Part::Warped);
    });
}

void start_writing_forward(const RegistrationRun& run, const OutputFolder& output, tbb::task_group& tasks) {
    const Writer writer(run, output, tasks);
    writer.start(moving_to_fixed_name, [&](auto& path) {
        write_displacement_field(run.products.moving_to_fixed, path, imaging::FieldType::Modeling);
    });
    start_optional(writer, Part::Forward);
}

/// 1 where tissue is gone, 2 where it parted.
imaging::Volume gone_or_parted(const RegistrationRun& run) {
    imaging::Volume result = run.products.parted.clone();
    result.voxels *= 2;
    if (!run.products.gap.empty()) result.voxels += run.products.gap.voxels;
    return result;
}

void start_writing_estimates(const RegistrationRun& run, const OutputFolder& output, tbb::task_group& tasks) {
    const Writer writer(run, output, tasks);
    const Products& products = run.products;
    if (products.uncertainty) {
        const registration::UncertaintyVolumes& volumes = products.uncertainty_volumes;
        writer.start("uncertainty.nii.gz", [&](auto& path) { write_volume(volumes.deviation, path); });
        writer.start("uncertainty_trust.nii.gz", [&](auto& path) { write_volume(volumes.trust, path); });
    }
    if (writes_gap(run.options)) writer.start(gap_name, [&](auto& path) { write_volume(gone_or_parted(run), path); });
    writer.start("record.h5",
                 [&](auto& path) { registration::write_record(*run.prepared, run.result, record_info(run), path); });
    if (run.inputs.landmarks) writer.start("warped_landmarks.csv", [&](auto& path) { write_landmarks(run, path); });
    if (run.inputs.points) writer.start("warped_points.csv", [&](auto& path) { write_points(run, path); });
    start_optional(writer, Part::Estimates);
}

report::Pictures draw_pictures(const RegistrationRun& run) {
    const auto given = [](const imaging::Volume& volume) { return volume.empty() ? nullptr : &volume; };
    const Products& products = run.products;
    const registration::Deformation& deformation = run.result.deformation;
    const Eigen::Matrix3Xd nodes = deformation.deformed_nodes();
    return report::draw_pictures({given(run.inputs.moving), given(run.inputs.fixed), given(products.warped),
                                  &run.inputs.moving_labels, given(run.inputs.fixed_labels), &products.warped_labels,
                                  &products.moving_to_fixed, given(products.uncertainty_volumes.deviation),
                                  given(products.uncertainty_volumes.trust), &products.fixed_to_moving,
                                  &deformation.mesh, &nodes, alignment_json(run)});
}

void write_reports(const nlohmann::json& report, const report::Pictures& pictures, const OutputFolder& output) {
    write_json(report, output.path("report.json"));
    report::write_report(report, pictures, output.staging());
}

std::string summary_text(const RegistrationRun& run, double total_seconds) {
    std::string text = "stage                  seconds\n";
    for (const auto& [stage, seconds] : run.times) text += fmt::format("  {:<20}{:>8.2f}\n", stage, seconds);
    text += fmt::format("  {:<20}{:>8.2f}\n", "total", total_seconds);
    if (const auto& error = run.scores.target_error) {
        text += "target error (mm)        count    mean  median    95th     max\n";
        text += summary_row("before", error->before) + summary_row("after", error->after);
        const std::string moved = fmt::format("moved > {:g} mm, ", error->moved_mm);
        text += summary_row(moved + "before", error->moved_before) + summary_row(moved + "after", error->moved_after);
    }
    if (const auto& curves = run.scores.curves) {
        text += "curves to lines (mm)     count    mean  median    95th     max\n";
        text += summary_row("before", curves->before) + summary_row("after", curves->after);
    }
    for (std::size_t n = 0; n < run.result.images.size(); ++n) {
        const registration::ImageFit& fit = run.result.images[n];
        text += fmt::format("{}: {} of {} blocks found, {:.2f} mm from the tissue; near {:.0f} % of the organ\n",
                            n == 0 ? "image" : fmt::format("contrast {}", n + 1), fit.matched, fit.blocks,
                            fit.residual_mm, 100 * fit.shown_share);
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
    if (const auto& fit = run.result.anchors)
        text += fmt::format("anchors: {} nodes, moved by at most {:.2f} mm\n", fit->nodes, fit->largest_mm);
    if (!run.products.gap.empty()) text += resected_text(run);
    text += fmt::format("from data at hand to warped image: {:.2f} s\n", run.intraoperative_seconds);
    if (run.dial) text += "chosen: " + run.dial->reason + "\n";
    if (const auto& error = run.products.uncertainty) text += estimate_text(registration::summarise(*error));
    if (!run.scores.after.empty()) text += "Dice                      before   after\n";
    for (const auto& [label, after] : run.scores.after)
        text += fmt::format("  {:<22}{:>8.3f}{:>8.3f}\n",
                            label == 0 ? "all labels" : imaging::label_title(label, run.inputs.label_names),
                            run.scores.before.contains(label) ? run.scores.before.at(label).dice : 0.0, after.dice);
    text +=
        fmt::format("det J of the mesh: minimum {:.3f}, folded {}\n", run.scores.mesh.minimum, run.scores.mesh.folded);
    for (const std::vector<std::string>* notes : {&run.inputs.notes, &run.notes})
        for (const std::string& note : *notes)
            if (!run.dial || note != run.dial->reason) text += "note: " + note + "\n";  // said above
    for (const registration::Doubt& doubt : run.result.doubts)
        text += fmt::format("{}: {}\n", name_of(doubt.severity), full_text(doubt));
    if (!run.result.doubts.empty()) text += "what doubts mean: docs/manual/doubts.md\n";
    return text + "results in " + run.options.output.string() + "\n";
}

}  // namespace tissuewarp::apps
