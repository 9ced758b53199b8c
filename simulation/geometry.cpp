#include "simulation/geometry.hpp"

#include "core/errors.hpp"
#include "imaging/labels.hpp"
#include "meshing/mesher.hpp"
#include "meshing/primitives.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

namespace tissuewarp::simulation {
namespace {

using Eigen::Vector3d;

constexpr double most_voxels = 3e8;

Box bounds(const Shape& shape) {
    if (const auto* box = std::get_if<Box>(&shape.solid)) return *box;
    const auto& ellipsoid = std::get<Ellipsoid>(shape.solid);
    return {ellipsoid.centre - ellipsoid.radii, ellipsoid.centre + ellipsoid.radii};
}

bool contains(const Shape& shape, const Vector3d& point) {
    if (const auto* box = std::get_if<Box>(&shape.solid))
        return (point - box->lower).minCoeff() >= 0 && (box->upper - point).minCoeff() >= 0;
    const auto& ellipsoid = std::get<Ellipsoid>(shape.solid);
    return (point - ellipsoid.centre).cwiseQuotient(ellipsoid.radii).norm() <= 1;
}

std::string list(const std::vector<int>& labels) {
    std::string text;
    for (const int label : labels) text += (text.empty() ? "" : ", ") + std::to_string(label);
    return text;
}

meshing::TetMesh meshed(const imaging::Volume& labels, double edge, const std::map<int, double>& label_edge,
                        const Scene& scene, Observer& observer) {
    meshing::MeshingOptions options;
    options.edge_length = edge;
    options.label_edge_length = label_edge;
    for (const auto& [label, tissue] : scene.tissues) options.labels.push_back(label);
    imaging::require_labels(labels, options.labels, "the label map of the scene");
    std::vector<int> left_out;
    for (const int label : imaging::labels_in(labels))
        if (!scene.tissues.contains(label)) left_out.push_back(label);
    if (!left_out.empty()) observer.note("labels without a tissue are not meshed: " + list(left_out));
    return meshing::mesh_labels(labels, options, observer);
}

meshing::TetMesh mesh_from(const LabelledVolume& geometry, const Scene& scene, Observer& observer) {
    return meshed(geometry.labels, geometry.edge_length, geometry.label_edge_length, scene, observer);
}

meshing::TetMesh mesh_from(const meshing::TetMesh& mesh, const Scene&, Observer&) {
    return mesh;
}

meshing::TetMesh mesh_from(const BoxGeometry& geometry, const Scene&, Observer&) {
    meshing::TetMesh mesh = meshing::box_mesh(geometry.size, geometry.cells);
    mesh.nodes.colwise() += geometry.lower;
    return mesh;
}

meshing::TetMesh mesh_from(const ShapeGeometry& geometry, const Scene& scene, Observer& observer) {
    double shortest = geometry.edge_length;
    for (const auto& [label, length] : geometry.label_edge_length) shortest = std::min(shortest, length);
    return meshed(painted(geometry.shapes, shortest / 4), geometry.edge_length, geometry.label_edge_length, scene,
                  observer);
}

void require_tissues(const meshing::TetMesh& mesh, const Scene& scene) {
    std::vector<int> labels(mesh.labels.begin(), mesh.labels.end());
    std::sort(labels.begin(), labels.end());
    labels.erase(std::unique(labels.begin(), labels.end()), labels.end());
    std::erase_if(labels, [&](int label) { return scene.tissues.contains(label); });
    if (!labels.empty())
        throw InvalidInput("the mesh of the scene has label " + list(labels) + " without a tissue; add [label." +
                           std::to_string(labels.front()) + "]");
    for (const auto& [label, tissue] : scene.tissues)
        if (!(mesh.labels.array() == label).any())
            throw InvalidInput("label " + std::to_string(label) + " has a tissue but no tetrahedron of the mesh");
}

}  // namespace

meshing::TetMesh mesh_of(const Scene& scene, Observer& observer) {
    meshing::TetMesh mesh =
        std::visit([&](const auto& geometry) { return mesh_from(geometry, scene, observer); }, scene.geometry);
    require_tissues(mesh, scene);
    return mesh;
}

const imaging::Volume* label_volume(const Scene& scene) {
    const auto* geometry = std::get_if<LabelledVolume>(&scene.geometry);
    return geometry ? &geometry->labels : nullptr;
}

imaging::Volume painted(const std::vector<Shape>& shapes, double spacing) {
    Vector3d lower = Vector3d::Constant(std::numeric_limits<double>::infinity()), upper = -lower;
    for (const Shape& shape : shapes) {
        if (shape.label == 0) continue;
        lower = lower.cwiseMin(bounds(shape).lower);
        upper = upper.cwiseMax(bounds(shape).upper);
    }
    imaging::Geometry grid;
    grid.spacing.setConstant(spacing);
    grid.origin = lower.array() - 2 * spacing;
    const Vector3d voxels = ((upper - lower) / spacing).array().ceil() + 5;
    if (!(voxels.prod() < most_voxels))
        throw InvalidInput("the shapes of the scene take " + std::to_string(voxels.prod()) +
                           " voxels of a quarter of the edge length; give a larger edge_length_mm");
    for (int axis = 0; axis < 3; ++axis) grid.size[static_cast<std::size_t>(axis)] = static_cast<int>(voxels[axis]);
    imaging::Volume labels(grid, CV_32SC1);
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i) {
                const Vector3d point = grid.point({double(i), double(j), double(k)});
                const auto top = std::find_if(shapes.rbegin(), shapes.rend(),
                                              [&](const Shape& shape) { return contains(shape, point); });
                if (top != shapes.rend()) labels.data<std::int32_t>()[labels.offset(i, j, k)] = top->label;
            }
    return labels;
}

}  // namespace tissuewarp::simulation
