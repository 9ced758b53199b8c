#include "study/detail/truth.hpp"

#include "core/errors.hpp"
#include "meshing/mesher.hpp"
#include "tled/reference.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <string>

namespace tissuewarp::study::detail {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

namespace {

constexpr double least_jacobian = 0.3, largest_jacobian = 3;

double volume(const imaging::Volume& labels) {
    const auto* first = labels.data<std::int32_t>();
    return double(std::count_if(first, first + labels.geometry.voxel_count(), [](int label) { return label > 0; })) *
           labels.geometry.voxel_volume();
}

double largest_motion(const Matrix3Xd& displacement) {
    return displacement.colwise().norm().maxCoeff();
}

/// The first step of Newton's method under small loads, scaled to the loads.
Matrix3Xd linear_answer(const tled::QuadraticTetrahedra& energy, const TruthMesh& mesh, const OrganShape& shape,
                        const RandomLoads& loads) {
    constexpr double small = 1e-3, any_mm = 1;
    const auto conditions = conditions_on(mesh.quadratic, mesh.corners, shape, scaled(loads, small));
    return tled::newton_equilibrium(energy, conditions, {.tolerance_mm = any_mm}).displacement / small;
}

void require_sound(const Truth& truth, const Eigen::VectorXd& jacobians, double motion_mm) {
    if (truth.min_jacobian < least_jacobian || jacobians.maxCoeff() > largest_jacobian)
        throw SolverFailure("the truth has det F from " + std::to_string(truth.min_jacobian) + " to " +
                            std::to_string(jacobians.maxCoeff()) + ", which tissue does not survive");
    const double reached = largest_motion(truth.displacement);
    if (reached > 2 * motion_mm)
        throw SolverFailure("the truth moves by " + std::to_string(reached) + " mm where " + std::to_string(motion_mm) +
                            " mm were wanted");
}

}  // namespace

TruthMesh truth_mesh(const OrganShape& shape, int elements, Observer& observer) {
    const imaging::Volume labels = draw(shape, 0.02 * shape.length());
    meshing::MeshingOptions options;
    constexpr double edges_cubed_per_volume = 10;  // of the mesher's tetrahedra
    options.edge_length = std::cbrt(edges_cubed_per_volume * volume(labels) / elements);
    options.label_edge_length[2] = std::min(options.edge_length, 0.6 * shape.inclusion_radius());
    TruthMesh mesh{meshing::mesh_labels(labels, options, observer), {}};
    for (const meshing::InterfaceFace& face : meshing::interface_faces(mesh.corners))
        for (const int node : face.nodes) mesh.corners.nodes.col(node) = shape.on_surface(mesh.corners.nodes.col(node));
    mesh.quadratic = tled::quadratic_mesh(
        mesh.corners, [&shape](const Vector3d& a, const Vector3d& b) { return shape.on_surface(0.5 * (a + b)); });
    return mesh;
}

Truth deformed_organ(const OrganShape& shape, const RandomTissue& tissue, const RandomLoads& loads, double motion_mm,
                     int elements, Observer& observer) {
    constexpr double locks_from = 0.475;
    Truth truth{truth_mesh(shape, elements, observer), {}};
    const auto pressure =
        tissue.poisson_ratio > locks_from ? tled::QuadraticPressure::NodalAverage : tled::QuadraticPressure::Pointwise;
    const tled::QuadraticTetrahedra energy(truth.mesh.quadratic, tissue.materials,
                                           {tled::Quadrature::Points4, pressure});
    const double linear = largest_motion(linear_answer(energy, truth.mesh, shape, loads));
    const RandomLoads wanted = scaled(loads, motion_mm / linear);
    const auto conditions = conditions_on(truth.mesh.quadratic, truth.mesh.corners, shape, wanted);
    truth.displacement = tled::newton_equilibrium(energy, conditions, {.tolerance_mm = 1e-5}, observer).displacement;
    const Eigen::VectorXd jacobians = energy.jacobians(truth.displacement);
    truth.min_jacobian = jacobians.minCoeff();
    require_sound(truth, jacobians, motion_mm);
    return truth;
}

}  // namespace tissuewarp::study::detail
