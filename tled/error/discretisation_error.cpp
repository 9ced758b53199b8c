#include "tled/error/discretisation_error.hpp"

#include "core/errors.hpp"
#include "tled/error/enrichment.hpp"
#include "tled/model/kinematics.hpp"
#include "tled/parallel/parallel.hpp"

#include <chrono>
#include <cmath>
#include <optional>

namespace tissuewarp::tled {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

/// Pressure (kPa) with which the model's own elements are in equilibrium.
VectorXd model_pressure(const Model& model, const RestState& averaged, const VectorXd& jacobian) {
    const std::vector<VolumetricFunction> nodal =
        model.element == Element::T4 ? std::vector<VolumetricFunction>() : detail::nodal_volumetric(averaged, jacobian);
    const std::vector<int> material_of = material_of_elements(averaged);
    VectorXd result(averaged.element_count());
    parallel_for(0, averaged.element_count(), [&](int e) {
        const Material material = detail::element_material(averaged, material_of[e], e);
        result[e] = nodal.empty() ? volumetric_modulus(material) * volumetric_function(material, jacobian[e]).first
                                  : detail::element_pressure(averaged, e, material, jacobian[e], nodal);
    });
    return result;
}

std::string unsupported(const NodalConditions& conditions) {
    const NodalEffects& effects = conditions.effects;
    if (!effects.surface.empty() || effects.fluid || effects.contact) {
        return "pressures, membranes, pairs that slide or part, fluid and contact have no estimate";
    }
    return {};
}

std::string inverted(const RestState& rest, const VectorXd& jacobian) {
    const std::vector<int> material_of = material_of_elements(rest);
    for (int e = 0; e < jacobian.size(); ++e) {
        if (jacobian[e] > 0.0 || (admits_inversion(rest.materials[material_of[e]]) && std::isfinite(jacobian[e])))
            continue;
        return "tetrahedron " + std::to_string(rest.tet[e]) + " has det F = " + std::to_string(jacobian[e]);
    }
    return {};
}

void require_sizes(const Model& model, const NodalConditions& conditions, const Matrix3Xd& displacement) {
    const int count = model.mesh.node_count();
    if (displacement.cols() == count && conditions.constrained.cols() == count) return;
    throw InvalidInput("a mesh of " + std::to_string(count) + " nodes has displacements of " +
                       std::to_string(displacement.cols()) + " and conditions of " +
                       std::to_string(conditions.constrained.cols()) + "; give those of the same mesh");
}

// The corners of the internal order back to those of the mesh.
Eigen::Matrix<int, 6, Eigen::Dynamic> in_mesh_order(const Eigen::Matrix<int, 6, Eigen::Dynamic>& edges,
                                                    const std::vector<int>& tet) {
    Eigen::Matrix<int, 6, Eigen::Dynamic> result(6, edges.cols());
    for (Eigen::Index e = 0; e < edges.cols(); ++e) result.col(tet[static_cast<std::size_t>(e)]) = edges.col(e);
    return result;
}

}  // namespace

Vector3d DiscretisationError::at(const meshing::TetMesh& mesh, int tet, const Eigen::Vector4d& barycentric) const {
    Vector3d result = Vector3d::Zero();
    for (int c = 0; c < 4; ++c) result += barycentric[c] * corner.col(mesh.tets(c, tet));
    for (int k = 0; k < 6; ++k) {
        const auto [a, b] = detail::tetrahedron_edges[k];
        result += 4.0 * barycentric[a] * barycentric[b] * bubble.col(edges_of(k, tet));
    }
    return result;
}

DiscretisationEstimate discretisation_error(const Model& model, const RestStiffness& stiffness,
                                            const NodalConditions& conditions, const Matrix3Xd& displacement,
                                            const DistributedLoads& loads, const DiscretisationOptions& options) {
    const auto start = std::chrono::steady_clock::now();
    require_sizes(model, conditions, displacement);
    static_cast<void>(stiffness.diagonal(conditions));  // refuses a factor of other constraints
    if (std::string reason = unsupported(conditions); !reason.empty()) return {std::nullopt, std::move(reason)};
    Model with_averages = model;
    with_averages.element = Element::AveragedPressureT4;
    const RestState rest = rest_state(with_averages);
    const VectorXd jacobian = detail::element_jacobians(rest, displacement);
    if (std::string reason = inverted(rest, jacobian); !reason.empty()) return {std::nullopt, std::move(reason)};

    std::vector<bool> averaged;
    for (const Material& material : rest.materials) {
        averaged.push_back(suggested_element({{1, material}}) == Element::AveragedPressureT4);
    }
    const detail::HierarchicalSpace space = detail::hierarchical_space(rest.nodes, rest.node_count);
    const detail::BubbleConditions bubbles =
        bubble_conditions(space, rest.volume, model.mesh, conditions, displacement, loads);
    const auto step = [&](detail::Moduli moduli) {
        std::optional<detail::Enrichment> enrichment;
        Matrix3Xd residual;
        {  // the tissue, which takes some 800 bytes an element, is gone while the system is solved
            const detail::HierarchicalTissue tissue = hierarchical_tissue(space, rest, averaged, displacement, moduli);
            residual = detail::residual(tissue, model_pressure(model, rest, jacobian));
            residual.rightCols(space.edge_count()) += bubbles.force;
            enrichment.emplace(tissue, bubbles, conditions, stiffness);
        }
        return enrichment->solve(std::move(residual), options);
    };
    detail::Enrichment::Solution found = step(detail::Moduli::Exact);
    if (!found.failure.empty()) found = step(detail::Moduli::PositivePart);
    if (!found.failure.empty()) return {std::nullopt, std::move(found.failure)};
    const std::chrono::duration<double> time = std::chrono::steady_clock::now() - start;
    return {DiscretisationError{found.x.leftCols(space.corner_count), found.x.rightCols(space.edge_count()), space.edge,
                                in_mesh_order(space.edge_of, rest.tet), found.iterations, time.count()},
            {}};
}

}  // namespace tissuewarp::tled
