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
    const imaging::Volume organ = organ_of(run.inputs.moving_labels, run.options);
    return report::draw_pictures({given(run.inputs.moving), given(run.inputs.fixed), given(products.warped),
                                  &run.inputs.moving_labels, given(run.inputs.fixed_labels), &products.warped_labels,
                                  &products.moving_to_fixed, given(products.uncertainty_volumes.deviation),
                                  given(products.uncertainty_volumes.trust), &products.fixed_to_moving,
                                  &deformation.mesh, &nodes, alignment_json(run), &organ});
}

void write_reports(const nlohmann::json& report, const report::Pictures& pictures, const OutputFolder& output) {
    write_json(report, output.path("report.json"));
    report::write_report(report, pictures, output.staging());
}

}  // namespace tissuewarp::apps
