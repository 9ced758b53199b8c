#include "registration/springs/ground_springs.hpp"

#include <cmath>

namespace tissuewarp::registration::detail {

double strain_energy_unit(const PreparedModel& prepared, const TissuePrior& tissue) {
    const meshing::TetMesh& mesh = prepared.model.mesh;
    const Eigen::VectorXd volumes = meshing::tet_volumes(mesh);
    double energy = 0;
    for (Eigen::Index tet = 0; tet < volumes.size(); ++tet) {
        const tled::Material& material = prepared.model.materials.at(mesh.labels[static_cast<std::size_t>(tet)]);
        const double youngs_modulus = 2 * tled::shear_modulus(material) * (1 + tled::poisson_ratio(material));
        energy += volumes[tet] * youngs_modulus;
    }
    const double modulus = energy / volumes.sum();
    return modulus * tissue.expected_strain * tissue.expected_strain * std::pow(tissue.strain_length_mm, 3);
}

namespace {

/// Of the wall of a cavity and of surfaces that slide: free, and still a piece of tissue that nothing else holds stays
/// somewhere. As surfaces in view (ImageOptions::expected_motion_mm).
constexpr double free_surface_motion_mm = 100;

}  // namespace

std::vector<tled::Spring> ground_springs(const PreparedModel& prepared, double energy,
                                         const std::function<ExpectedMotion(const InterfaceNode&)>& expected) {
    std::vector<tled::Spring> springs;
    for (const InterfaceNode& node : prepared.interfaces.nodes()) {
        if (node.outer != 0 && !node.slides) continue;
        const bool free = node.at_cavity || node.slides;
        const ExpectedMotion motion = free ? ExpectedMotion(free_surface_motion_mm) : expected(node);
        const Eigen::Matrix3d across = node.normal * node.normal.transpose(),
                              along = Eigen::Matrix3d::Identity() - across,
                              information = across / (motion.across_mm * motion.across_mm) +
                                            along / (motion.along_mm * motion.along_mm);
        springs.push_back(
            {node.node, energy * node.area / ground_options.independent_area * information, Eigen::Vector3d::Zero()});
    }
    return springs;
}

void expect_free_motion(LastPulls& pulls, const PreparedModel& prepared, double motion_mm) {
    std::erase_if(pulls.springs, [](const PulledNode& pulled) { return pulled.origin == Origin::Prior; });
    for (const tled::Spring& spring :
         ground_springs(prepared, pulls.energy, [&](const InterfaceNode&) { return motion_mm; }))
        pulls.springs.push_back({spring, Origin::Prior});
    pulls.prior_moves = PriorMoves::WithSurface;
}

}  // namespace tissuewarp::registration::detail
