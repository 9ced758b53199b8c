// tissuewarp study patient: drawn patients as files, to try registrations on whose truth is known.

#include "apps/output_folder.hpp"
#include "apps/point_files.hpp"
#include "apps/progress.hpp"
#include "apps/silenced_stderr.hpp"
#include "apps/study.hpp"
#include "core/errors.hpp"
#include "imaging/filters.hpp"
#include "imaging/image_io.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>

namespace tissuewarp::apps {

namespace {

namespace fs = std::filesystem;

constexpr std::array names{"preop.nii.gz",          "preop_labels.nii.gz", "intraop.nii.gz",
                           "intraop_labels.nii.gz", "intraop_surface.csv", "pairs.csv",
                           "preop_vessels.csv",     "intraop_vessels.csv", "landmarks.csv"};

bool is_patient_file(const std::string& name) {
    return std::find(names.begin(), names.end(), name) != names.end();
}

void write_pairs(const Eigen::Matrix3Xd& moving, const Eigen::Matrix3Xd& fixed, const fs::path& path) {
    std::vector<Column> columns;
    append_points(columns, "pre_", moving);
    append_points(columns, "intra_", fixed);
    write_columns(columns, path);
}

void write_points(const Eigen::Matrix3Xd& points, const fs::path& path) {
    std::vector<Column> columns;
    append_points(columns, "", points);
    write_columns(columns, path);
}

void write_lines(const std::vector<Eigen::Matrix3Xd>& lines, const fs::path& path) {
    Eigen::Index count = 0, at = 0;
    for (const Eigen::Matrix3Xd& line : lines) count += line.cols();
    Eigen::Matrix3Xd points(3, count);
    Eigen::VectorXd numbers(count);
    for (std::size_t n = 0; n < lines.size(); ++n) {
        points.middleCols(at, lines[n].cols()) = lines[n];
        numbers.segment(at, lines[n].cols()).setConstant(double(n));
        at += lines[n].cols();
    }
    std::vector<Column> columns;
    append_points(columns, "", points);
    columns.push_back({"line", numbers});
    write_columns(columns, path);
}

/// Labels on the voxels of an image, as register wants them.
void write_labels_on(const imaging::Volume& labels, const imaging::Geometry& grid, const fs::path& path) {
    imaging::write_volume(imaging::resample(labels, grid, imaging::Interpolation::Nearest), path);
}

/// What ultrasound shows is seen by it alone; other data are of the whole organ.
void write_ultrasound(const study::Phantom& patient, const OutputFolder& output) {
    const study::PhantomUltrasound images = patient.ultrasound();
    imaging::write_volume(images.moving, output.path("preop.nii.gz"));
    imaging::write_volume(images.fixed, output.path("intraop.nii.gz"));
    write_labels_on(patient.moving_labels, images.moving.geometry, output.path("preop_labels.nii.gz"));
    std::vector<Eigen::Index> seen;
    for (Eigen::Index n = 0; n < patient.targets.fixed.cols(); ++n)
        if (images.shows(patient.targets.fixed.col(n))) seen.push_back(n);
    write_pairs(patient.targets.moving(Eigen::all, seen), patient.targets.fixed(Eigen::all, seen),
                output.path("landmarks.csv"));
}

void write_all(const study::Phantom& patient, const OutputFolder& output) {
    const study::PhantomImages images = patient.images();
    imaging::write_volume(images.moving, output.path("preop.nii.gz"));
    imaging::write_volume(images.fixed, output.path("intraop.nii.gz"));
    write_labels_on(patient.moving_labels, images.moving.geometry, output.path("preop_labels.nii.gz"));
    write_labels_on(patient.fixed_labels, images.fixed.geometry, output.path("intraop_labels.nii.gz"));
    write_points(patient.surface.points, output.path("intraop_surface.csv"));
    write_pairs(patient.points.moving, patient.points.fixed, output.path("pairs.csv"));
    write_lines(patient.curves.moving, output.path("preop_vessels.csv"));
    write_points(patient.curves.fixed, output.path("intraop_vessels.csv"));
    write_pairs(patient.targets.moving, patient.targets.fixed, output.path("landmarks.csv"));
}

}  // namespace

void run_patient_study(const StudyOptions& options) {
    if (options.output.empty()) throw InvalidInput("give --output, the folder for a patient, or for folders of each");
    ProgressLine progress(options.common);
    const study::CoverageOptions plan = coverage_plan(options, progress);
    const bool ultrasound = plan.evidence == std::vector{study::Evidence::Ultrasound};
    const double count = double(plan.last_seed - plan.first_seed + 1);
    for (std::uint64_t seed = plan.first_seed; seed <= plan.last_seed; ++seed) {
        const double done = double(seed - plan.first_seed);
        progress.begin(fmt::format("drawing patient {}", seed), done / count, (done + 1) / count);
        const study::Phantom patient = study::random_phantom(seed, plan.phantom, progress);
        OutputFolder output(count > 1 ? options.output / std::to_string(seed) : options.output, is_patient_file);
        {
            const SilencedStandardError silenced;
            ultrasound ? write_ultrasound(patient, output) : write_all(patient, output);
        }
        output.commit();
        progress.clear();
        if (!options.common.quiet) fmt::print("{}: {}\n", output.folder().string(), patient.story);
    }
}

}  // namespace tissuewarp::apps
