// What of the inputs cannot be registered.

#include "apps/inputs.hpp"

#include "apps/moving_organ.hpp"
#include "imaging/filters.hpp"
#include "imaging/labels.hpp"
#include "registration/io/curves.hpp"
#include "registration/prepare.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tissuewarp::apps {
namespace fs = std::filesystem;
using imaging::Geometry;
using imaging::Volume;

namespace {

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

void require_known_surroundings(const Volume& moving_labels, const PreoperativeOptions& options) {
    registration::PrepareOptions named;
    named.anchors = options.anchors;
    named.rigid_neighbours = options.rigid_neighbours;
    named.resected = options.resected;
    named.sliding = options.sliding;
    try {
        registration::require_surroundings(moving_labels, named);
    } catch (const InvalidInput& problem) {
        throw InvalidInput(fmt::format("'{}', --anchor, --rigid-neighbour, --resected and --sliding: {}",
                                       organ_file(options).string(), problem.what()));
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

Volume organ_of(const Volume& labels, const PreoperativeOptions& options) {
    std::vector<int> others = options.rigid_neighbours;
    others.insert(others.end(), options.resected.begin(), options.resected.end());
    return imaging::without_labels(labels, others);
}

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

void require_labels_of_tissues(const std::map<int, std::string>& label_tissue, const Volume& labels,
                               const fs::path& path) {
    std::vector<int> named;
    for (const auto& [label, tissue] : label_tissue) named.push_back(label);
    if (named.empty()) return;
    imaging::require_labels(labels, named, fmt::format("'{}', --label-tissue", path.string()).c_str());
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

void validate_preoperative(RegistrationInputs& inputs, const PreoperativeOptions& options, bool resample_labels) {
    match_grid(inputs.moving_labels, inputs.moving, options.moving, options.moving_labels, resample_labels);
    require_millimetres(inputs.moving_labels.geometry, organ_file(options));
    imaging::require_labels(inputs.moving_labels, {}, organ_file(options).string().c_str());
    require_known_surroundings(inputs.moving_labels, options);
    const Volume organ = organ_of(inputs.moving_labels, options);
    require_labels_of_lengths(options.label_edge_length, organ, organ_file(options));
    require_labels_of_tissues(options.label_tissue, organ, organ_file(options));
    if (!options.materials.empty()) require_materials(inputs.materials, imaging::labels_in(organ), options.materials);
}

void validate_intraoperative(RegistrationInputs& inputs, const RegisterOptions& options) {
    if (!inputs.fixed_labels.empty()) validate_fixed_labels(inputs, options);
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
