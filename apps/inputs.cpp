#include "apps/inputs.hpp"

#include "apps/initial_transform.hpp"
#include "apps/match_masks.hpp"
#include "apps/moving_organ.hpp"
#include "apps/naming_page.hpp"
#include "apps/noted_images.hpp"
#include "apps/point_files.hpp"
#include "core/sha256.hpp"
#include "imaging/filters.hpp"
#include "imaging/labels.hpp"
#include "registration/io/curves.hpp"
#include "registration/io/surface_points.hpp"
#include "registration/update.hpp"

#include <fmt/format.h>
#include <tbb/task_group.h>

#include <algorithm>
#include <cmath>
#include <functional>

namespace tissuewarp::apps {
namespace fs = std::filesystem;
using imaging::Geometry;
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

void require_common_label(const Volume& moving, const Volume& fixed, const RegisterOptions& options) {
    const std::vector<int> a = imaging::labels_in(moving), b = imaging::labels_in(fixed);
    std::vector<int> common;
    std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(common));
    if (!common.empty()) return;
    throw InvalidInput(fmt::format(
        "'{}' (labels {}) and '{}' (labels {}) share no label; give the same tissue the same number",
        organ_file(options).string(), fmt::join(a, ", "), options.fixed_labels.string(), fmt::join(b, ", ")));
}

/// Corners of the box around the labels, LPS mm.
std::pair<Eigen::Vector3d, Eigen::Vector3d> label_box(const Volume& labels) {
    Eigen::Vector3d lower = Eigen::Vector3d::Constant(INFINITY), upper = -lower;
    for (const auto& [label, statistics] : imaging::label_statistics(labels))
        for (int corner = 0; corner < 8; ++corner) {
            Eigen::Vector3d index;
            for (int axis = 0; axis < 3; ++axis) {
                const auto a = static_cast<std::size_t>(axis);
                index[axis] = (corner >> axis & 1) ? statistics.upper[a] - 0.5 : statistics.lower[a] - 0.5;
            }
            lower = lower.cwiseMin(labels.geometry.point(index));
            upper = upper.cwiseMax(labels.geometry.point(index));
        }
    return {lower, upper};
}

/// Without alignment the organs must already lie within the search range of each other.
void require_organs_meet(const RegistrationInputs& inputs) {
    constexpr double search_mm = 15.0;  // UpdateOptions::first_range_mm
    Volume placed = inputs.moving_labels;
    if (inputs.start) {
        placed.geometry.origin = inputs.start->placement * placed.geometry.origin;
        placed.geometry.direction = inputs.start->placement.linear() * placed.geometry.direction;
    }
    const auto [lower_a, upper_a] = label_box(placed);
    const auto [lower_b, upper_b] = label_box(inputs.fixed_labels);
    const double gap = (lower_a - upper_b).cwiseMax(lower_b - upper_a).maxCoeff();
    if (gap <= search_mm) return;
    throw InvalidInput(fmt::format(
        "the labelled organs lie {:.1f} mm apart, beyond the search of {:g} mm; drop --no-align", gap, search_mm));
}

void match_grid(Volume& labels, const Volume& image, const fs::path& image_path, const fs::path& labels_path,
                bool resample) {
    if (image.empty()) return;
    if (!imaging::same_grid(image.geometry, labels.geometry)) {
        if (!resample)
            require_same_grid(image.geometry, labels.geometry, image_path.string(), labels_path.string(),
                              "give labels drawn on that image, or add --resample-labels");
        labels = imaging::resample(labels, image.geometry, imaging::Interpolation::Nearest);
    }
    labels.geometry = image.geometry;  // headers that differ in a late digit are one grid
}

void require_known_surroundings(const Volume& moving_labels, const RegisterOptions& options) {
    registration::PrepareOptions named;
    named.anchors = options.anchors;
    named.rigid_neighbours = options.rigid_neighbours;
    try {
        registration::require_surroundings(moving_labels, named);
    } catch (const InvalidInput& problem) {
        throw InvalidInput(
            fmt::format("'{}', --anchor and --rigid-neighbour: {}", organ_file(options).string(), problem.what()));
    }
}

void validate_fixed_labels(RegistrationInputs& inputs, const RegisterOptions& options) {
    inputs.fixed_labels_as_given = inputs.fixed_labels;
    match_grid(inputs.fixed_labels, inputs.fixed, options.fixed, options.fixed_labels, options.resample_labels);
    require_millimetres(inputs.fixed_labels.geometry, options.fixed_labels);
    imaging::require_labels(inputs.fixed_labels, {}, options.fixed_labels.string().c_str());
    require_common_label(inputs.moving_labels, inputs.fixed_labels, options);
    require_same_numbers(inputs.moving_label_names, organ_file(options), inputs.fixed_label_names,
                         options.fixed_labels);
    if (options.no_align) require_organs_meet(inputs);
}

}  // namespace

void require_same_numbers(const imaging::LabelNames& names, const fs::path& path,
                          const imaging::LabelNames& other_names, const fs::path& other_path) {
    for (const auto& [label, name] : names)
        for (const auto& [other, other_name] : other_names)
            if (name == other_name && label != other)
                throw InvalidInput(
                    fmt::format("'{}' calls label {} '{}' and '{}' gives that name to label {}; give the same tissue "
                                "the same number",
                                path.string(), label, name, other_path.string(), other));
}

void require_labels_of_lengths(const std::map<int, double>& label_edge_length, const Volume& labels,
                               const fs::path& path) {
    std::vector<int> named;
    for (const auto& [label, length] : label_edge_length) named.push_back(label);
    if (named.empty()) return;
    imaging::require_labels(labels, named, fmt::format("'{}', --label-edge-length", path.string()).c_str());
}

void require_millimetres(const Geometry& grid, const fs::path& path) {
    double extent = 0;
    for (int axis = 0; axis < 3; ++axis)
        extent = std::max(extent, grid.spacing[axis] * grid.size[static_cast<std::size_t>(axis)]);
    constexpr double least_mm = 10.0, most_mm = 3000.0;
    if (extent >= least_mm && extent <= most_mm) return;
    throw InvalidInput(
        fmt::format("'{}' spans {:g} mm, outside {:g} to {:g} mm; its spacing is probably in other units: write it in "
                    "millimetres",
                    path.string(), extent, least_mm, most_mm));
}

void check_inside(const Eigen::Matrix3Xd& points, const Geometry& grid, const std::string& what,
                  std::vector<std::string>& notes) {
    Eigen::Index outside = 0;
    for (Eigen::Index p = 0; p < points.cols(); ++p) {
        const Eigen::Vector3d index = grid.index(points.col(p));
        bool inside = true;
        for (int axis = 0; axis < 3; ++axis)
            inside &= index[axis] >= -0.5 && index[axis] <= grid.size[static_cast<std::size_t>(axis)] - 0.5;
        outside += !inside;
    }
    if (outside == 0) return;
    const std::string text = fmt::format("{} of {} {} lie outside the image", outside, points.cols(), what);
    if (2 * outside > points.cols()) throw InvalidInput(text + "; coordinates must be LPS mm: for RAS, negate x and y");
    notes.push_back(text);
}

void require_same_grid(const Geometry& image, const Geometry& labels, const std::string& image_name,
                       const std::string& labels_name, const std::string& remedy) {
    if (imaging::same_grid(image, labels)) return;
    const auto text = [](const Geometry& g) { return fmt::format("{}x{}x{}", g.size[0], g.size[1], g.size[2]); };
    const double distance = imaging::grid_distance(image, labels);
    const std::string difference = std::isinf(distance)
                                       ? fmt::format("{} and {} voxels", text(image), text(labels))
                                       : fmt::format("corners up to {:.3g} voxels apart, 0.001 allowed", distance);
    throw InvalidInput(
        fmt::format("'{}' and '{}' are not on one grid ({}); {}", image_name, labels_name, difference, remedy));
}

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

void read_point_files(RegistrationInputs& inputs, const RegisterOptions& options) {
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

/// Side by side, but for contours, which are drawn on the image's voxels. What is not given stays as it is.
void read_image_and_labels(const fs::path& image_path, const fs::path& labels_path, imaging::ReadResult& image,
                           imaging::ReadResult& labels) {
    const bool contours = !image_path.empty() && !labels_path.empty() && imaging::is_structure_set(labels_path);
    tbb::task_group tasks;
    if (!image_path.empty()) tasks.run([&] { image = imaging::read_volume_with_notes(image_path); });
    if (!labels_path.empty() && !contours) tasks.run([&] { labels = imaging::read_labels_with_notes(labels_path); });
    tasks.wait();
    if (contours) labels = imaging::read_structures_on(labels_path, image.volume.geometry);
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

}  // namespace

RegistrationInputs read_inputs(const RegisterOptions& options, Observer& observer) {
    RegistrationInputs inputs;
    const std::vector<std::pair<const char*, const fs::path*>> roles{{"moving", &options.moving},
                                                                     {"moving-labels", &options.moving_labels},
                                                                     {"moving-surface", &options.moving_surface},
                                                                     {"moving-mesh", &options.moving_mesh},
                                                                     {"moving-mask", &options.moving_mask},
                                                                     {"fixed", &options.fixed},
                                                                     {"fixed-mask", &options.fixed_mask},
                                                                     {"fixed-labels", &options.fixed_labels},
                                                                     {"fixed-surface", &options.fixed_surface},
                                                                     {"fixed-points", &options.point_pairs.fixed},
                                                                     {"moving-points", &options.point_pairs.moving},
                                                                     {"moving-curves", &options.curves.moving},
                                                                     {"fixed-curves", &options.curves.fixed},
                                                                     {"materials", &options.materials},
                                                                     {"label-names", &options.label_names},
                                                                     {"initial-transform", &options.initial_transform},
                                                                     {"landmarks", &options.landmarks.csv},
                                                                     {"landmarks-moving", &options.landmarks.moving},
                                                                     {"landmarks-fixed", &options.landmarks.fixed},
                                                                     {"points", &options.points},
                                                                     {"surface", &options.surface}};
    for (const auto& [role, path] : roles) add_file(inputs, role, *path);
    for (const fs::path& path : options.moving_contrasts) add_file(inputs, "moving", path);
    for (const fs::path& path : options.fixed_contrasts) add_file(inputs, "fixed", path);
    if (!options.materials.empty()) inputs.materials = read_materials(options.materials);
    if (!options.label_names.empty()) inputs.label_names = imaging::read_label_names(options.label_names);
    naming_page(points_page, [&] { read_point_files(inputs, options); });
    observer.checkpoint("reading", 0.1);

    imaging::ReadResult moving, fixed, moving_labels, fixed_labels;
    tbb::task_group tasks;
    tasks.run([&] {
        naming_page(images_page,
                    [&] { read_image_and_labels(options.moving, options.moving_labels, moving, moving_labels); });
    });
    tasks.run([&] {
        naming_page(images_page,
                    [&] { read_image_and_labels(options.fixed, options.fixed_labels, fixed, fixed_labels); });
    });
    tasks.run([&] {
        for (InputFile& file : inputs.files)
            if (fs::is_regular_file(file.path)) file.sha256 = sha256_of_file(file.path);
    });
    tasks.wait();
    for (const auto& [read, path] : {std::pair{&moving, &options.moving},
                                     {&moving_labels, &options.moving_labels},
                                     {&fixed, &options.fixed},
                                     {&fixed_labels, &options.fixed_labels}})
        for (const std::string& note : notes_of(*read, *path)) inputs.notes.push_back(note);
    inputs.moving = moving.volume;
    inputs.fixed = fixed.volume;
    require_grey(inputs.moving, options.moving);
    require_grey(inputs.fixed, options.fixed);
    inputs.moving_labels = moving_labels.volume;
    inputs.fixed_labels = fixed_labels.volume;
    inputs.moving_label_names = moving_labels.label_names;
    inputs.fixed_label_names = fixed_labels.label_names;
    inputs.moving_contrasts = read_contrasts(options.moving_contrasts, inputs.notes);
    inputs.fixed_contrasts = read_contrasts(options.fixed_contrasts, inputs.notes);
    find_organ(inputs, options);
    for (const imaging::LabelNames* names : {&inputs.moving_label_names, &inputs.fixed_label_names})
        inputs.label_names.insert(names->begin(), names->end());
    for (const auto& [label, tissue] : inputs.materials) inputs.label_names.emplace(label, tissue.name);
    exclude_unmatched(inputs, options);
    take_initial_transform(inputs, options);
    observer.checkpoint("reading", 1.0);
    return inputs;
}

void validate(RegistrationInputs& inputs, const RegisterOptions& options) {
    match_grid(inputs.moving_labels, inputs.moving, options.moving, options.moving_labels, options.resample_labels);
    require_millimetres(inputs.moving_labels.geometry, organ_file(options));
    imaging::require_labels(inputs.moving_labels, {}, organ_file(options).string().c_str());
    if (!inputs.fixed_labels.empty()) validate_fixed_labels(inputs, options);
    require_known_surroundings(inputs.moving_labels, options);
    const Volume organ = imaging::without_labels(inputs.moving_labels, options.rigid_neighbours);
    require_labels_of_lengths(options.label_edge_length, organ, organ_file(options));
    if (!options.materials.empty()) require_materials(inputs.materials, imaging::labels_in(organ), options.materials);
    const auto check_moving = [&](const Eigen::Matrix3Xd& points, const char* what) {
        check_inside(points, inputs.moving_grid(), what, inputs.notes);
    };
    const auto check_fixed = [&](const Eigen::Matrix3Xd& points, const char* what) {
        if (const Geometry* grid = inputs.fixed_grid()) check_inside(points, *grid, what, inputs.notes);
    };
    if (inputs.landmarks) {
        check_moving(inputs.landmarks->moving, "moving landmarks");
        check_fixed(inputs.landmarks->fixed, "fixed landmarks");
    }
    if (inputs.point_pairs) {
        check_moving(inputs.point_pairs->moving, "moving points");
        check_fixed(inputs.point_pairs->fixed, "fixed points");
    }
    if (inputs.curves) {
        check_moving(registration::points_of(inputs.curves->moving), "points of the moving curves");
        check_fixed(inputs.curves->fixed, "points of the fixed curves");
    }
    if (inputs.fixed_surface) check_fixed(inputs.fixed_surface->points, "points of the fixed surface");
    if (inputs.points) check_moving(*inputs.points, "points");
    if (inputs.surface) check_moving(inputs.surface->nodes, "points of the surface");
}

}  // namespace tissuewarp::apps
