// tissuewarp warp: carries an image, a label map, points or a surface through a registration or a scene.

#include "registration/warp.hpp"

#include "apps/displacement_field.hpp"
#include "apps/file_kind.hpp"
#include "apps/module_description.hpp"
#include "apps/noted_images.hpp"
#include "apps/output_folder.hpp"
#include "apps/point_files.hpp"
#include "apps/progress.hpp"
#include "apps/silenced_stderr.hpp"
#include "apps/verbs.hpp"
#include "apps/warp_motion.hpp"
#include "core/errors.hpp"
#include "meshing/mesh_io.hpp"
#include "registration/field.hpp"
#include "registration/io/slicer_markups.hpp"
#include "registration/resection/gap.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <vector>

namespace tissuewarp::apps {

namespace {

using imaging::Volume;

/// The field that was given, unless its file says that it carries the points of the other image.
Volume displacement(const WarpOptions& options, imaging::FieldType needed, Observer& observer) {
    const auto stated = imaging::stated_field_type(options.displacement);
    if (stated && *stated != needed)
        throw InvalidInput(fmt::format(
            "'{}' says 'displacement field type:={}', and '{}' takes {}; give the other field, or turn this one with "
            "tissuewarp convert --to {} --reference IMAGE",
            options.displacement.string(), name_of(*stated), options.input.string(), name_of(needed), name_of(needed)));
    return read_displacement(options.displacement, observer);
}

void warp_volume(const WarpOptions& options, const std::optional<WarpMotion>& motion, Observer& observer) {
    Volume image =
        options.labels ? read_noted_labels(options.input, observer) : read_noted_volume(options.input, observer);
    Volume field;
    if (motion) {
        take_out(image, *motion, options.labels ? 0 : options.outside, options.input);
        const imaging::Geometry grid =
            options.reference.empty() ? image.geometry : read_noted_volume(options.reference, observer).geometry;
        field = registration::displacement_fixed_to_moving(motion->deformation, grid, {options.fade}, observer);
        registration::unfold_fixed_to_moving(field, motion->deformation);
    } else {
        field = displacement(options, imaging::FieldType::Resampling, observer);
    }
    Volume warped = options.labels ? registration::warp_labels(image, field)
                                   : registration::warp_image(image, field, options.outside);
    if (motion && !motion->resected.empty())
        registration::leave_gap(warped, registration::gap_after(motion->deformation, motion->resected, field),
                                options.labels ? 0 : options.outside);
    const SilencedStandardError silenced;
    imaging::write_volume(warped, options.output);
}

/// Points of other units or another frame would be carried along rigidly, as what lies outside of all tissue is.
void require_near(const Eigen::Matrix3Xd& points, const meshing::TetMesh& mesh, const std::filesystem::path& path) {
    constexpr double farthest_mm = 500;  // larger than an organ
    const Eigen::Vector3d lower = mesh.nodes.rowwise().minCoeff(), upper = mesh.nodes.rowwise().maxCoeff();
    std::vector<double> distances;
    for (const auto& point : points.colwise())
        distances.push_back((lower - point).cwiseMax(point - upper).cwiseMax(0).norm());
    const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
    std::nth_element(distances.begin(), middle, distances.end());
    if (*middle <= farthest_mm) return;
    throw InvalidInput(
        fmt::format("'{}' lies {:.0f} mm from the model, more than {:g}; coordinates must "
                    "be LPS mm of the moving image",
                    path.string(), *middle, farthest_mm));
}

Eigen::Matrix3Xd map_points(const WarpOptions& options, const std::optional<WarpMotion>& motion,
                            const Eigen::Matrix3Xd& points, Observer& observer) {
    if (!motion) return displaced(points, displacement(options, imaging::FieldType::Modeling, observer));
    require_near(points, motion->deformation.mesh, options.input);
    return registration::PointTransform(motion->deformation, {options.fade})(points);
}

void warp_points(const WarpOptions& options, const std::optional<WarpMotion>& motion, Observer& observer) {
    const Eigen::Matrix3Xd points = read_points(options.input, observer);
    Eigen::Matrix3Xd mapped = map_points(options, motion, points, observer);
    if (motion) {
        const std::vector<bool> gone = points_gone(points, *motion);
        for (Eigen::Index p = 0; p < points.cols(); ++p)
            if (gone[static_cast<std::size_t>(p)]) mapped.col(p).setConstant(std::numeric_limits<double>::quiet_NaN());
        if (const auto count = std::count(gone.begin(), gone.end(), true); count > 0)
            observer.note(fmt::format("{} of {} points lay in tissue that was taken out; they are written as nan",
                                      count, points.cols()));
    }
    std::vector<Column> columns;
    append_points(columns, "", mapped);
    write_columns(columns, options.output);
}

void warp_surface(const WarpOptions& options, const std::optional<WarpMotion>& motion, Observer& observer) {
    meshing::SurfaceMesh surface = read_tissue_surface(options.input, observer);
    if (motion) {
        const std::vector<bool> gone = points_gone(surface.nodes, *motion);
        if (const auto count = std::count(gone.begin(), gone.end(), true); count > 0)
            throw InvalidInput(fmt::format(
                "{} of {} nodes of '{}' lie in tissue that was taken out; give a surface of what is left, or --frame "
                "with one before the resection",
                count, surface.node_count(), options.input.string()));
    }
    surface.nodes = map_points(options, motion, surface.nodes, observer);
    meshing::write_surface(surface, options.output);
}

}  // namespace

void run_warp(const WarpOptions& options) {
    ProgressLine progress(options.common);
    const FileKind kind = file_kind(options.input);
    const bool writes_markups = registration::is_slicer_markups(options.output);
    if (file_kind(options.output) != kind || writes_markups)
        throw InvalidInput("'" + options.input.string() + "' cannot become '" + options.output.string() +
                           "'; give an output of the same kind (image, points as .csv or surface)");
    require_could_write_file(options.output);
    progress.begin("warping", 0.0, 1.0);
    const std::optional<WarpMotion> motion = read_motion(options, progress);
    if (kind == FileKind::Image) {
        warp_volume(options, motion, progress);
    } else if (kind == FileKind::Points) {
        warp_points(options, motion, progress);
    } else if (kind == FileKind::Surface) {
        warp_surface(options, motion, progress);
    } else {
        throw InvalidInput("'" + options.input.string() +
                           "' is of no kind that can be warped; give an image, points (.csv, .xyz, .fcsv, .mrk.json) "
                           "or a surface (.ply, .stl, "
                           ".obj, .vtk, .vtp)");
    }
    write_return_parameters(options.common.return_parameters, {});
    progress.clear();
    if (options.common.quiet) return;
    for (const std::string& note : progress.notes()) fmt::print("note: {}\n", note);
}

}  // namespace tissuewarp::apps
