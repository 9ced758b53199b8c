#include "apps/moving_organ.hpp"

#include "meshing/mesh_io.hpp"
#include "meshing/surface_voxels.hpp"
#include "registration/field/mesh_labels.hpp"

#include <fmt/format.h>

#include <cmath>

namespace tissuewarp::apps {

namespace {

/// Between the volumes of a surface by its triangles and by its voxels, of the latter; beyond it crosses itself. By
/// hand: small bodies on coarse grids differ by some hundredths, a body inside out by more than half.
constexpr double most_volume_difference = 0.05;

void take_foreground(RegistrationInputs& inputs, const PreoperativeOptions& options) {
    try {
        inputs.foreground = imaging::foreground(inputs.moving);
    } catch (const InvalidInput& problem) {
        throw InvalidInput(
            fmt::format("'{}': {}; draw it, and give --moving-labels", options.moving.string(), problem.what()));
    }
    inputs.moving_labels = inputs.foreground->labels;
    inputs.notes.push_back(fmt::format(
        "no labels say where the organ is: what is brighter than {:.4g} in '{}' was taken, its largest piece without "
        "holes, {:.4g} ml; see its outline in preview.png, and give --moving-labels where that is not the organ",
        inputs.foreground->threshold, options.moving.string(), inputs.foreground->volume_mm3 / 1000));
}

void require_one_body(const meshing::ClosedSurface& surface, const imaging::Volume& inside, const std::string& path) {
    const double by_voxels = cv::countNonZero(inside.voxels.reshape(1, 1)) * inside.geometry.voxel_volume();
    if (surface.volume_mm3 == 0 || std::abs(surface.volume_mm3 - by_voxels) < most_volume_difference * by_voxels)
        return;
    throw InvalidInput(
        fmt::format("'{}' holds {:.4g} ml by its triangles and {:.4g} ml by what they enclose: it crosses "
                    "itself, or inner surfaces face outward; make it anew from the segmentation",
                    path, surface.volume_mm3 / 1000, by_voxels / 1000));
}

/// The grid of the moving image, where there is one, and then the body must lie in it.
imaging::Geometry grid_for(const meshing::ClosedSurface& surface, RegistrationInputs& inputs, const char* what) {
    if (inputs.moving.empty()) return meshing::grid_about(surface);
    check_inside(surface.mesh.nodes, inputs.moving.geometry, what, inputs.notes);
    return inputs.moving.geometry;
}

void take_surface(RegistrationInputs& inputs, const PreoperativeOptions& options) {
    const std::string path = options.moving_surface.string();
    meshing::ClosedSurface surface;
    try {
        surface = meshing::closed_surface(meshing::read_surface(options.moving_surface).mesh);
    } catch (const InvalidInput& problem) {
        const std::string text = problem.what();
        throw InvalidInput(text.starts_with("'") ? text : fmt::format("'{}' {}", path, text));
    }
    for (const std::string& note : surface.notes) inputs.notes.push_back(fmt::format("'{}': {}", path, note));
    const imaging::Geometry grid = grid_for(surface, inputs, "points of the moving surface");
    require_millimetres(grid, options.moving_surface);
    const imaging::Volume inside = meshing::voxels_inside(surface.mesh, grid);
    require_one_body(surface, inside, path);
    inputs.moving_labels = inside.as(CV_32S);
}

void take_mesh(RegistrationInputs& inputs, const PreoperativeOptions& options) {
    meshing::MeshFile file = meshing::read_tetrahedra(options.moving_mesh);
    for (const std::string& note : file.notes)
        inputs.notes.push_back(fmt::format("'{}': {}", options.moving_mesh.string(), note));
    const meshing::ClosedSurface outside{
        meshing::boundary_surface(file.mesh).surface, meshing::tet_volumes(file.mesh).sum(), {}};
    const imaging::Geometry grid = grid_for(outside, inputs, "nodes of the moving mesh");
    require_millimetres(grid, options.moving_mesh);
    inputs.moving_labels = registration::labels_of_mesh(file.mesh, grid);
    inputs.moving_label_names = std::move(file.label_names);
    inputs.moving_mesh = std::move(file.mesh);
}

}  // namespace

const std::filesystem::path& organ_file(const PreoperativeOptions& options) {
    for (const auto* path : {&options.moving_labels, &options.moving_surface, &options.moving_mesh})
        if (!path->empty()) return *path;
    return options.moving;
}

void find_organ(RegistrationInputs& inputs, const PreoperativeOptions& options) {
    if (!options.moving_surface.empty())
        take_surface(inputs, options);
    else if (!options.moving_mesh.empty())
        take_mesh(inputs, options);
    else if (options.moving_labels.empty())
        take_foreground(inputs, options);
}

}  // namespace tissuewarp::apps
