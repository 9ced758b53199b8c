#include "study/detail/truth.hpp"

#include "core/errors.hpp"
#include "meshing/mesher.hpp"
#include "tled/model/internal_force.hpp"
#include "tled/reference/newton.hpp"

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

}  // namespace

tled::QuadraticTetrahedra elements_of(const TruthMesh& mesh, const RandomTissue& tissue) {
    constexpr double locks_from = 0.475;
    const auto pressure =
        tissue.poisson_ratio > locks_from ? tled::QuadraticPressure::NodalAverage : tled::QuadraticPressure::Pointwise;
    return {mesh.quadratic, tissue.materials, {tled::Quadrature::Points4, pressure}};
}

double bearable_jacobians(const tled::QuadraticTetrahedra& energy, const Matrix3Xd& displacement) {
    const Eigen::VectorXd jacobians = energy.jacobians(displacement);
    if (jacobians.minCoeff() < least_jacobian || jacobians.maxCoeff() > largest_jacobian)
        throw SolverFailure("the truth has det F from " + std::to_string(jacobians.minCoeff()) + " to " +
                            std::to_string(jacobians.maxCoeff()) + ", which tissue does not survive");
    return jacobians.minCoeff();
}

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

RandomOrgan random_organ(Random& random) {
    OrganShape shape(random);
    RandomTissue tissue = random_tissue(random);
    RandomLoads loads = random_loads(shape, tissue.youngs_modulus_kpa, random);
    return {std::move(shape), std::move(tissue), std::move(loads)};
}

RandomLoads sized_loads(const RandomOrgan& organ, const TruthMesh& mesh, double motion_mm) {
    constexpr double small = 1e-3, any_mm = 1;  // the first step of Newton's method under small loads
    const auto energy = elements_of(mesh, organ.tissue);
    const auto conditions = conditions_on(mesh.quadratic, mesh.corners, organ.shape, scaled(organ.loads, small));
    const auto linear = tled::newton_equilibrium(energy, conditions, {.tolerance_mm = any_mm}).displacement;
    return scaled(organ.loads, motion_mm * small / linear.colwise().norm().maxCoeff());
}

Truth equilibrium(const RandomOrgan& organ, TruthMesh mesh, Observer& observer) {
    const auto energy = elements_of(mesh, organ.tissue);
    const auto conditions = conditions_on(mesh.quadratic, mesh.corners, organ.shape, organ.loads);
    Truth truth;
    truth.displacement = tled::newton_equilibrium(energy, conditions, {.tolerance_mm = 1e-5}, observer).displacement;
    truth.mesh = std::move(mesh);
    truth.min_jacobian = bearable_jacobians(energy, truth.displacement);
    return truth;
}

}  // namespace tissuewarp::study::detail
