#include "apps/inputs.hpp"

#include "apps/initial_transform.hpp"
#include "apps/match_masks.hpp"
#include "apps/moving_organ.hpp"
#include "apps/naming_page.hpp"
#include "apps/noted_images.hpp"
#include "apps/point_files.hpp"
#include "core/sha256.hpp"
#include "registration/io/curves.hpp"
#include "registration/io/surface_points.hpp"

#include <fmt/format.h>
#include <tbb/task_group.h>

namespace tissuewarp::apps {
namespace fs = std::filesystem;
using imaging::Volume;

namespace {

void add_file(RegistrationInputs& inputs, const char* role, const fs::path& path) {
    if (path.empty()) return;
    std::error_code failure;
    if (!fs::exists(path, failure)) throw IoError(fmt::format("--{} '{}': no such file", role, path.string()));
    inputs.files.push_back({role, path, ""});
}

void require_grey(const Volume& image, const fs::path& path) {
    if (image.channels() > 1)
        throw InvalidInput(fmt::format("'{}' has {} components; give a grey image", path.string(), image.channels()));
}

}  // namespace

std::optional<registration::Landmarks> read_landmark_files(const LandmarkFiles& files, Observer& observer) {
    if (!files.csv.empty()) return registration::read_landmarks(files.csv, observer);
    if (!files.moving.empty()) return registration::read_landmarks(files.moving, files.fixed, observer);
    return std::nullopt;
}

std::optional<registration::PointPairs> read_point_pairs(const PointPairFiles& files, Observer& observer) {
    if (files.fixed.empty()) return std::nullopt;
    registration::Landmarks pairs = files.moving.empty()
                                        ? registration::read_landmarks(files.fixed, observer)
                                        : registration::read_landmarks(files.moving, files.fixed, observer);
    return registration::PointPairs{std::move(pairs.moving), std::move(pairs.fixed), files.deviation};
}

namespace {

/// What readers of points and surfaces note becomes a note of the inputs.
class InputNotes final : public Observer {
public:
    explicit InputNotes(std::vector<std::string>& notes) : notes_(notes) {}
    void note(std::string_view message) override { notes_.emplace_back(message); }

private:
    std::vector<std::string>& notes_;
};

void read_point_files(RegistrationInputs& inputs, const IntraoperativeOptions& options) {
    InputNotes notes(inputs.notes);
    inputs.landmarks = read_landmark_files(options.landmarks, notes);
    inputs.point_pairs = read_point_pairs(options.point_pairs, notes);
    if (!options.fixed_surface.empty())
        inputs.fixed_surface =
            registration::read_surface_points(options.fixed_surface, options.surface_deviation, notes);
    if (!options.curves.fixed.empty())
        inputs.curves =
            registration::read_curves(options.curves.moving, options.curves.fixed, options.curves.deviation, notes);
    if (!options.points.empty()) inputs.points = read_points(options.points, notes);
    if (!options.surface.empty()) inputs.surface = read_tissue_surface(options.surface, notes);
}

/// An image and its label map, as they were read.
struct ImagesRead {
    imaging::ReadResult image, labels;
};

/// Side by side, but for contours, which are drawn on the image's voxels. What is not given stays as it is.
ImagesRead read_both(const fs::path& image_path, const fs::path& labels_path) {
    ImagesRead read;
    const bool contours = !image_path.empty() && !labels_path.empty() && imaging::is_structure_set(labels_path);
    tbb::task_group tasks;
    if (!image_path.empty()) tasks.run([&] { read.image = imaging::read_volume_with_notes(image_path); });
    if (!labels_path.empty() && !contours)
        tasks.run([&] { read.labels = imaging::read_labels_with_notes(labels_path); });
    tasks.wait();
    if (contours) read.labels = imaging::read_structures_on(labels_path, read.image.volume.geometry);
    return read;
}

ImagesRead read_image_and_labels(const fs::path& image_path, const fs::path& labels_path) {
    return naming_page(images_page, [&] { return read_both(image_path, labels_path); });
}

std::vector<Volume> read_contrasts(const std::vector<fs::path>& paths, std::vector<std::string>& notes) {
    std::vector<Volume> result;
    for (const fs::path& path : paths) {
        const imaging::ReadResult read =
            naming_page(images_page, [&] { return imaging::read_volume_with_notes(path); });
        require_grey(read.volume, path);
        require_millimetres(read.volume.geometry, path);
        for (const std::string& note : notes_of(read, path)) notes.push_back(note);
        result.push_back(read.volume);
    }
    return result;
}

using Roles = std::vector<std::pair<const char*, const fs::path*>>;

void add_files(RegistrationInputs& inputs, const Roles& roles, const char* contrast_role,
               const std::vector<fs::path>& contrasts) {
    for (const auto& [role, path] : roles) add_file(inputs, role, *path);
    for (const fs::path& path : contrasts) add_file(inputs, contrast_role, path);
}

void add_preoperative_files(RegistrationInputs& inputs, const PreoperativeOptions& options) {
    add_files(inputs,
              {{"moving", &options.moving},
               {"moving-labels", &options.moving_labels},
               {"moving-surface", &options.moving_surface},
               {"moving-mesh", &options.moving_mesh},
               {"moving-mask", &options.moving_mask},
               {"materials", &options.materials},
               {"label-names", &options.label_names}},
              "moving", options.moving_contrasts);
}

void add_intraoperative_files(RegistrationInputs& inputs, const IntraoperativeOptions& options) {
    add_files(inputs,
              {{"fixed", &options.fixed},
               {"fixed-mask", &options.fixed_mask},
               {"fixed-labels", &options.fixed_labels},
               {"fixed-surface", &options.fixed_surface},
               {"fixed-points", &options.point_pairs.fixed},
               {"moving-points", &options.point_pairs.moving},
               {"moving-curves", &options.curves.moving},
               {"fixed-curves", &options.curves.fixed},
               {"initial-transform", &options.initial_transform},
               {"landmarks", &options.landmarks.csv},
               {"landmarks-moving", &options.landmarks.moving},
               {"landmarks-fixed", &options.landmarks.fixed},
               {"points", &options.points},
               {"surface", &options.surface}},
              "fixed", options.fixed_contrasts);
}

/// Those without a digest.
void hash_files(std::vector<InputFile>& files) {
    for (InputFile& file : files)
        if (file.sha256.empty() && fs::is_regular_file(file.path)) file.sha256 = sha256_of_file(file.path);
}

void note_reading(RegistrationInputs& inputs, const ImagesRead& read, const fs::path& image, const fs::path& labels) {
    for (const std::string& note : notes_of(read.image, image)) inputs.notes.push_back(note);
    for (const std::string& note : notes_of(read.labels, labels)) inputs.notes.push_back(note);
}

void take_moving(RegistrationInputs& inputs, const PreoperativeOptions& options, const ImagesRead& read) {
    if (!options.materials.empty()) inputs.materials = read_materials(options.materials);
    for (const auto& [label, tissue] : options.label_tissue) inputs.materials[label] = entry_of_tissue(tissue);
    if (!options.label_names.empty()) inputs.label_names = imaging::read_label_names(options.label_names);
    note_reading(inputs, read, options.moving, options.moving_labels);
    inputs.moving = read.image.volume;
    require_grey(inputs.moving, options.moving);
    inputs.moving_labels = read.labels.volume;
    inputs.moving_label_names = read.labels.label_names;
    inputs.moving_contrasts = read_contrasts(options.moving_contrasts, inputs.notes);
    find_organ(inputs, options);
    exclude_unmatched_moving(inputs, options);
}

void take_fixed(RegistrationInputs& inputs, const IntraoperativeOptions& options, const ImagesRead& read) {
    note_reading(inputs, read, options.fixed, options.fixed_labels);
    inputs.fixed = read.image.volume;
    require_grey(inputs.fixed, options.fixed);
    inputs.fixed_labels = read.labels.volume;
    inputs.fixed_label_names = read.labels.label_names;
    inputs.fixed_contrasts = read_contrasts(options.fixed_contrasts, inputs.notes);
    exclude_unmatched_fixed(inputs, options);
    take_initial_transform(inputs, options);
}

void gather_label_names(RegistrationInputs& inputs) {
    for (const imaging::LabelNames* names : {&inputs.moving_label_names, &inputs.fixed_label_names})
        inputs.label_names.insert(names->begin(), names->end());
    for (const auto& [label, tissue] : inputs.materials) inputs.label_names.emplace(label, tissue.name);
}

}  // namespace

RegistrationInputs read_inputs(const RegisterOptions& options, Observer& observer) {
    RegistrationInputs inputs;
    add_preoperative_files(inputs, options);
    add_intraoperative_files(inputs, options);
    naming_page(points_page, [&] { read_point_files(inputs, options); });
    observer.checkpoint("reading", 0.1);
    ImagesRead moving, fixed;
    tbb::task_group tasks;
    tasks.run([&] { moving = read_image_and_labels(options.moving, options.moving_labels); });
    tasks.run([&] { fixed = read_image_and_labels(options.fixed, options.fixed_labels); });
    tasks.run([&] { hash_files(inputs.files); });
    tasks.wait();
    take_moving(inputs, options, moving);
    take_fixed(inputs, options, fixed);
    gather_label_names(inputs);
    observer.checkpoint("reading", 1.0);
    return inputs;
}

RegistrationInputs read_preoperative(const PreoperativeOptions& options, Observer& observer) {
    RegistrationInputs inputs;
    add_preoperative_files(inputs, options);
    ImagesRead moving;
    tbb::task_group tasks;
    tasks.run([&] { moving = read_image_and_labels(options.moving, options.moving_labels); });
    tasks.run([&] { hash_files(inputs.files); });
    tasks.wait();
    take_moving(inputs, options, moving);
    gather_label_names(inputs);
    observer.checkpoint("reading", 1.0);
    return inputs;
}

void read_intraoperative(RegistrationInputs& inputs, const IntraoperativeOptions& options, Observer& observer) {
    add_intraoperative_files(inputs, options);
    naming_page(points_page, [&] { read_point_files(inputs, options); });
    observer.checkpoint("reading", 0.1);
    ImagesRead fixed;
    tbb::task_group tasks;
    tasks.run([&] { fixed = read_image_and_labels(options.fixed, options.fixed_labels); });
    tasks.run([&] { hash_files(inputs.files); });
    tasks.wait();
    take_fixed(inputs, options, fixed);
    gather_label_names(inputs);
    observer.checkpoint("reading", 1.0);
}

}  // namespace tissuewarp::apps
