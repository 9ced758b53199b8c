#include "study/detail/resected_organ.hpp"

#include "core/errors.hpp"
#include "meshing/mesher.hpp"
#include "tled/reference/newton.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace tissuewarp::study::detail {

using Eigen::Vector3d;

namespace {

constexpr double least_ml = 10, most_ml = 60, mm3_per_ml = 1000;

constexpr double rim_mm = 5;  // over which the rim of an opening, and where a corridor meets the cavity, are rounded

/// The larger one of two distances, rounded where they are alike (Quilez's polynomial).
double rounded_max(double a, double b) {
    const double h = std::max(rim_mm - std::abs(a - b), 0.0) / rim_mm;
    return std::max(a, b) + 0.25 * h * h * rim_mm;
}

OrganShape organ_with_tumour(Random& random) {
    const double volume = mm3_per_ml * random.log_uniform(least_ml, most_ml);
    return OrganShape(random, {110, 160, std::cbrt(3 * volume / (4 * EIGEN_PI))});
}

}  // namespace

ResectedShape::ResectedShape(Random& random, Access access) : organ_(organ_with_tumour(random)) {
    const double part = random.uniform(0.8, 0.95);
    const Vector3d off = random.uniform(0.15, 0.3) * organ_.inclusion_radius() * random.direction();
    if (random.uniform() < 0.5) {
        scale_ = part;
        shift_ = off;
    }
    if (cavity_ml() < least_ml || cavity_ml() > most_ml)
        throw InvalidInput("phantom: the cavity that fits holds " + std::to_string(cavity_ml()) + " ml, not 10 to 60");
    if (access == Access::Corridor) corridor_ = shortest_way_out(random.uniform(0.5, 0.8) * cavity_radius());
}

ResectedShape::Corridor ResectedShape::shortest_way_out(double radius_mm) const {
    constexpr int steps = 20;
    constexpr double deepest_radii = 4;
    const Vector3d from = organ_.inclusion_centre() + shift_;
    Vector3d out = from;
    for (int step = 0; step < steps; ++step)  // downhill on the distance, as that is a rough one deep in the organ
        out -= 0.5 * organ_.outer_distance(out) * organ_.normal(out);
    if ((out - from).norm() > deepest_radii * cavity_radius())
        throw InvalidInput("phantom: the tumour lies too deep for a corridor");
    return {from, (out - from).normalized(), radius_mm};
}

double ResectedShape::cavity_ml() const {
    return std::pow(scale_, 3) * organ_.inclusion_volume() / mm3_per_ml;
}

Vector3d ResectedShape::in_tumour(const Vector3d& point) const {
    const Vector3d& middle = organ_.inclusion_centre();
    return middle + (point - middle - shift_) / scale_;
}

double ResectedShape::corridor_distance(const Vector3d& point) const {
    const auto& [from, along, radius_mm] = *corridor_;
    const Vector3d beyond = point - from;
    return (beyond - std::max(beyond.dot(along), 0.0) * along).norm() - radius_mm;
}

double ResectedShape::cavity_distance(const Vector3d& point) const {
    const double closed = scale_ * organ_.inclusion_distance(in_tumour(point));
    return corridor_ ? -rounded_max(-closed, -corridor_distance(point)) : closed;
}

double ResectedShape::surface_distance(const Vector3d& point) const {
    const double outer = organ_.outer_distance(point), wall = -cavity_distance(point);
    return is_open() ? rounded_max(outer, wall) : std::max(outer, wall);
}

bool ResectedShape::at_rim(const Vector3d& point) const {
    constexpr double wide_mm = 1.6 * rim_mm;  // an element beside it too
    if (!corridor_) return false;
    const double of_corridor = corridor_distance(point), closed = scale_ * organ_.inclusion_distance(in_tumour(point));
    return std::abs(organ_.outer_distance(point) + cavity_distance(point)) < wide_mm ||
           std::abs(closed - of_corridor) < wide_mm;
}

int ResectedShape::label(const Vector3d& point) const {
    const int of_organ = organ_.label(point);
    if (of_organ == 0) return 0;
    if (surface_distance(point) >= 0) return 2;
    return of_organ == 2 ? 3 : 1;
}

Vector3d ResectedShape::wall_normal(const Vector3d& point) const {
    constexpr double step = 1e-3;
    Vector3d slope;
    for (int axis = 0; axis < 3; ++axis) {
        const Vector3d e = step * Vector3d::Unit(axis);
        slope[axis] = cavity_distance(point + e) - cavity_distance(point - e);
    }
    return slope.normalized();
}

Vector3d ResectedShape::on_surface(const Vector3d& point) const {
    constexpr double near_mm = 4;
    if (at_rim(point)) return point;  // too round for the elements there to follow
    const double outer = organ_.outer_distance(point), wall = cavity_distance(point);
    if (std::min(std::abs(outer), std::abs(wall)) > near_mm) return point;
    Vector3d x = point;
    for (int iteration = 0; iteration < 5; ++iteration) {
        if (std::abs(outer) < std::abs(wall))
            x -= organ_.outer_distance(x) * organ_.normal(x);
        else
            x -= cavity_distance(x) * wall_normal(x);
    }
    return x;
}

ResectedOrgan random_resection(Random& random, Access access) {
    ResectedShape shape(random, access);
    RandomTissue tissue = random_tissue(random);
    RandomLoads loads = random_loads(shape.organ(), tissue.youngs_modulus_kpa, random);
    const bool air = random.uniform() < 0.5;
    // Gravity acts in full where cerebrospinal or other fluid has drained, and air is there instead.
    const double least_sag = air ? 0.5 : 0;
    const double sag = random.uniform(least_sag, 1) * 4 * tissue.youngs_modulus_kpa * 4 /
                       (shape.organ().length() * shape.organ().length());
    loads.body_force += sag * random.direction();
    const double relief = random.uniform(0.05, 0.25) * tissue.youngs_modulus_kpa;
    char words[160];
    std::snprintf(words, sizeof words, "; %.0f ml resected%s%s, %s in the cavity", shape.cavity_ml(),
                  shape.leaves_tumour() ? " and tumour left" : "", shape.is_open() ? " through a corridor" : "",
                  air ? "air" : "fluid");
    return {std::move(shape), std::move(tissue), std::move(loads), relief, air, words};
}

namespace {

/// Labels of what is meshed: the organ without the cavity, a layer about it, which takes finer elements.
imaging::Volume meshed_labels(const ResectedShape& shape, double layer_mm) {
    imaging::Volume labels = draw(shape.organ(), 0.015 * shape.organ().length());
    auto* voxel = labels.data<std::int32_t>();
    const auto& size = labels.geometry.size;
    for (int k = 0; k < size[2]; ++k)
        for (int j = 0; j < size[1]; ++j)
            for (int i = 0; i < size[0]; ++i, ++voxel) {
                if (*voxel == 0) continue;
                const Vector3d x = labels.geometry.point({double(i), double(j), double(k)});
                *voxel = shape.label(x) == 2 ? 0 : shape.cavity_distance(x) < layer_mm ? 2 : 1;
            }
    return labels;
}

double volume(const imaging::Volume& labels) {
    const auto* first = labels.data<std::int32_t>();
    return double(std::count_if(first, first + labels.geometry.voxel_count(), [](int label) { return label > 0; })) *
           labels.geometry.voxel_volume();
}

TruthMesh mesh_without(const ResectedShape& shape, int elements, Observer& observer) {
    constexpr double edges_cubed_per_volume = 10, layer_of_radius = 0.5, edge_of_radius = 0.45;
    const imaging::Volume labels = meshed_labels(shape, layer_of_radius * shape.cavity_radius());
    meshing::MeshingOptions options;
    options.edge_length = std::cbrt(edges_cubed_per_volume * volume(labels) / elements);
    options.label_edge_length[2] = std::min(options.edge_length, edge_of_radius * shape.cavity_radius());
    TruthMesh mesh{meshing::mesh_labels(labels, options, observer), {}};
    mesh.corners.labels.setOnes();
    for (const meshing::InterfaceFace& face : meshing::interface_faces(mesh.corners))
        for (const int node : face.nodes) mesh.corners.nodes.col(node) = shape.on_surface(mesh.corners.nodes.col(node));
    mesh.quadratic = tled::quadratic_mesh(
        mesh.corners, [&shape](const Vector3d& a, const Vector3d& b) { return shape.on_surface(0.5 * (a + b)); });
    for (int e = 0; e < mesh.corners.tet_count(); ++e) {  // as stiff as tumour where there is some
        const Vector3d middle = mesh.corners.nodes(Eigen::all, mesh.corners.tets.col(e)).rowwise().mean();
        const int label = shape.organ().label(middle) == 2 ? 2 : 1;
        mesh.corners.labels[e] = label;
        mesh.quadratic.labels[e] = label;
    }
    return mesh;
}

Vector3d middle_of(const TruthMesh& mesh, const meshing::InterfaceFace& face) {
    const auto& nodes = mesh.corners.nodes;
    return (nodes.col(face.nodes[0]) + nodes.col(face.nodes[1]) + nodes.col(face.nodes[2])) / 3;
}

/// Of the faces to the outside those of the cavity.
bool is_wall(const ResectedShape& shape, const TruthMesh& mesh, const meshing::InterfaceFace& face) {
    const Vector3d middle = middle_of(mesh, face);
    return std::abs(shape.cavity_distance(middle)) < std::abs(shape.organ().outer_distance(middle));
}

/// What the wall lacks, as nodal forces (3 × N, mN): a traction into the cavity.
Eigen::Matrix3Xd relief(const ResectedShape& shape, const TruthMesh& mesh, double kpa) {
    Eigen::Matrix3Xd forces = Eigen::Matrix3Xd::Zero(3, mesh.quadratic.node_count());
    for (const meshing::InterfaceFace& face : outer_faces(mesh.corners))
        if (is_wall(shape, mesh, face))
            tled::add_traction(mesh.quadratic, face.nodes, -kpa * shape.wall_normal(middle_of(mesh, face)), forces);
    return forces;
}

/// Loads from outside, and forces within.
struct Loading {
    RandomLoads loads;
    Eigen::Matrix3Xd forces;
};

Truth solved(const ResectedOrgan& organ, TruthMesh mesh, const Loading& loading, double motion_mm, Observer& observer) {
    constexpr double small = 1e-3, any_mm = 1;
    std::vector<meshing::InterfaceFace> outside = outer_faces(mesh.corners);
    std::erase_if(outside, [&](const meshing::InterfaceFace& face) { return is_wall(organ.shape, mesh, face); });
    const auto conditions = [&](double factor) {
        tled::NodalConditions all =
            conditions_on(mesh.quadratic, mesh.corners, outside, organ.shape.organ(), scaled(loading.loads, factor));
        all.external_force += factor * loading.forces;
        return all;
    };
    const tled::QuadraticTetrahedra energy = elements_of(mesh, organ.tissue);
    const auto linear = tled::newton_equilibrium(energy, conditions(small), {.tolerance_mm = any_mm}).displacement;
    const double factor = motion_mm * small / linear.colwise().norm().maxCoeff();
    Truth truth;
    truth.displacement =
        tled::newton_equilibrium(energy, conditions(factor), {.tolerance_mm = 1e-5}, observer).displacement;
    truth.min_jacobian = bearable_jacobians(energy, truth.displacement);
    truth.mesh = std::move(mesh);
    return truth;
}

}  // namespace

ResectionMeshes resection_meshes(const ResectedOrgan& organ, int elements, Observer& observer) {
    ResectionMeshes meshes{mesh_without(organ.shape, elements, observer),
                           truth_mesh(organ.shape.organ(), elements, observer)};
    (void)elements_of(meshes.resected, organ.tissue);
    (void)elements_of(meshes.whole, organ.tissue);
    return meshes;
}

Truth resected_truth(const ResectedOrgan& organ, TruthMesh mesh, double motion_mm, Observer& observer) {
    Eigen::Matrix3Xd forces = relief(organ.shape, mesh, organ.relief_kpa);
    return solved(organ, std::move(mesh), {organ.loads, std::move(forces)}, motion_mm, observer);
}

Truth unresected_truth(const ResectedOrgan& organ, TruthMesh mesh, double motion_mm, Observer& observer) {
    Eigen::Matrix3Xd none = Eigen::Matrix3Xd::Zero(3, mesh.quadratic.node_count());
    return solved(organ, std::move(mesh), {organ.loads, std::move(none)}, motion_mm, observer);
}

}  // namespace tissuewarp::study::detail
