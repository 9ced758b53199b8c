#include "tests/verification/effectivity.hpp"

namespace tissuewarp::verification {

using Eigen::Matrix3Xd;
using Eigen::VectorXd;

namespace {

double root_mean_square(const VectorXd& x) {
    return x.norm() / std::sqrt(static_cast<double>(x.size()));
}

tled::DistributedLoads distributed_loads(const Problem& problem, const meshing::TetMesh& mesh) {
    tled::DistributedLoads loads{.body_force = problem.body_force, .tractions = {}};
    for (const meshing::InterfaceFace& face : meshing::interface_faces(mesh)) {
        for (const Traction& traction : problem.tractions) {
            const auto on = [&](int node) { return traction.on(mesh.nodes.col(node)); };
            if (face.outer != 0 || !on(face.nodes[0]) || !on(face.nodes[1]) || !on(face.nodes[2])) continue;
            loads.tractions.push_back({face.nodes, traction.value});
        }
    }
    return loads;
}

tled::DiscretisationEstimate estimate(const Problem& problem, Elements elements, const Solution& linear) {
    const tled::Model model = linear_model(problem, elements, linear.mesh);
    const tled::NodalConditions conditions = nodal_conditions_of(problem, linear.mesh);
    return tled::discretisation_error(model, tled::RestStiffness(tled::rest_state(model), conditions), conditions,
                                      linear.displacement, distributed_loads(problem, linear.mesh));
}

/// The linear solution with the estimate added, on quadratic tetrahedra with straight edges.
Solution enriched(const Solution& linear, const tled::DiscretisationError& error) {
    Solution result;
    result.mesh = linear.mesh;
    result.curved = tled::quadratic_mesh(linear.mesh);
    result.displacement.resize(3, result.curved->node_count());
    const Matrix3Xd corners = linear.displacement + error.corner;
    result.displacement.leftCols(corners.cols()) = corners;
    for (Eigen::Index k = 0; k < error.edge.cols(); ++k) {
        const int a = error.edge(0, k), b = error.edge(1, k);
        result.displacement.col(result.curved->middle.at({a, b})) =
            0.5 * (corners.col(a) + corners.col(b)) + error.bubble.col(k);
    }
    return result;
}

}  // namespace

EffectivityStudy effectivity(const Problem& problem, Elements elements, int level, const Solution* quadratic) {
    const Solution linear = solve(problem, elements, level);
    const tled::DiscretisationEstimate found = estimate(problem, elements, linear);
    EffectivityStudy result{.tetrahedra = linear.mesh.tet_count(), .reason = found.reason, .quantities = {}};
    if (!found.error) return result;
    result.iterations = found.error->iterations;
    const Solution better = enriched(linear, *found.error);
    for (const Quantity& quantity : problem.quantities) {
        if (quantity.unit != "mm") continue;
        const VectorXd before = quantity.measure(linear), after = quantity.measure(better);
        Effectivity each{quantity.name, root_mean_square(after - before), root_mean_square(quantity.reference - before),
                         root_mean_square(quantity.uncertainty), root_mean_square(quantity.reference - after)};
        if (quadratic != nullptr) each.quadratic = root_mean_square(quantity.measure(*quadratic) - before);
        result.quantities.push_back(each);
    }
    return result;
}

}  // namespace tissuewarp::verification
