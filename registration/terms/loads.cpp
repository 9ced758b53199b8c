#include "registration/terms/loads.hpp"

namespace tissuewarp::registration::detail {

Eigen::Matrix3Xd nodal_forces(const PreparedModel& prepared, const TissueLoads& loads) {
    if (!loads.body_force.allFinite() || !std::isfinite(loads.pressure_kpa))
        throw InvalidInput("the loads on the tissue are not finite; give numbers of kPa/mm and kPa");
    const meshing::TetMesh& mesh = prepared.model.mesh;
    Eigen::Matrix3Xd forces = loads.body_force * (prepared.rest.lumped_mass / prepared.model.density).transpose();
    if (loads.pressure_kpa == 0) return forces;
    for (const std::array<int, 3>& face : prepared.interfaces.outer_faces()) {
        const Eigen::Vector3d a = mesh.nodes.col(face[0]), b = mesh.nodes.col(face[1]), c = mesh.nodes.col(face[2]);
        const Eigen::Vector3d outward = 0.5 * (b - a).cross(c - a);  // mm²
        for (const int node : face) forces.col(node) -= loads.pressure_kpa / 3 * outward;
    }
    return forces;
}

LoadTerm::LoadTerm(const PreparedModel& prepared, const TissueLoads& stated)
    : stated_(nodal_forces(prepared, stated)) {}

Contribution LoadTerm::linearise(const RoundPlan& /*plan*/, const State& state, Observer& /*observer*/) {
    Contribution result;
    result.forces = stated_;
    if (state.found_loads.cols() > 0) result.forces += state.found_loads;
    return result;
}

}  // namespace tissuewarp::registration::detail
