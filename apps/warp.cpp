// tissuewarp warp: carries an image, a label map, points or a surface through a registration that was made before.

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
#include "core/errors.hpp"
#include "meshing/mesh_io.hpp"
#include "registration/field.hpp"
#include "registration/io/slicer_markups.hpp"
#include "registration/record.hpp"

#include <fmt/format.h>

#include <algorithm>

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

/// The pulling field: the one that was given, or the record's on the reference grid.
Volume fixed_to_moving(const WarpOptions& options, const Volume& image, Observer& observer) {
    if (!options.displacement.empty()) return displacement(options, imaging::FieldType::Resampling, observer);
    const registration::Record record = registration::read_record(options.record);
    const imaging::Geometry grid =
        options.reference.empty() ? image.geometry : read_noted_volume(options.reference, observer).geometry;
    return registration::displacement_fixed_to_moving(record.deformation, grid, {options.fade}, observer);
}

void warp_volume(const WarpOptions& options, Observer& observer) {
    const Volume image =
        options.labels ? read_noted_labels(options.input, observer) : read_noted_volume(options.input, observer);
    const Volume field = fixed_to_moving(options, image, observer);
    const Volume warped = options.labels ? registration::warp_labels(image, field)
                                         : registration::warp_image(image, field, options.outside);
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
        fmt::format("'{}' lies {:.0f} mm from the model of the record, more than {:g}; coordinates must "
                    "be LPS mm of the moving image",
                    path.string(), *middle, farthest_mm));
}

Eigen::Matrix3Xd map_points(const WarpOptions& options, const Eigen::Matrix3Xd& points, Observer& observer) {
    if (!options.displacement.empty())
        return displaced(points, displacement(options, imaging::FieldType::Modeling, observer));
    const registration::Record record = registration::read_record(options.record);
    require_near(points, record.deformation.mesh, options.input);
    return registration::PointTransform(record.deformation, {options.fade})(points);
}

}  // namespace

void run_warp(const WarpOptions& options) {
    ProgressLine progress(options.common);
    if (options.record.empty() && options.displacement.empty())
        throw InvalidInput("nothing to warp with; give --record record.h5 or --displacement FIELD");
    const FileKind kind = file_kind(options.input);
    const bool writes_markups = registration::is_slicer_markups(options.output);
    if (file_kind(options.output) != kind || writes_markups)
        throw InvalidInput("'" + options.input.string() + "' cannot become '" + options.output.string() +
                           "'; give an output of the same kind (image, points as .csv or surface)");
    require_could_write_file(options.output);
    progress.begin("warping", 0.0, 1.0);
    if (kind == FileKind::Image) {
        warp_volume(options, progress);
    } else if (kind == FileKind::Points) {
        std::vector<Column> columns;
        append_points(columns, "", map_points(options, read_points(options.input, progress), progress));
        write_columns(columns, options.output);
    } else if (kind == FileKind::Surface) {
        meshing::SurfaceMesh surface = read_tissue_surface(options.input, progress);
        surface.nodes = map_points(options, surface.nodes, progress);
        meshing::write_surface(surface, options.output);
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
