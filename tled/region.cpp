#include "tled/region.hpp"

#include "core/errors.hpp"
#include "tled/nodal_effects.hpp"
#include "tled/stiffness/rest_stiffness.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

namespace tissuewarp::tled {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;

constexpr double answer_tolerance = 1e-7;  // of linear answers, in the norm of what preconditions them

/// The elements with `keep` equal to `side`, and the numbering of their nodes.
struct Part {
    Model model;
    std::vector<int> node_of;  // part → whole
    std::vector<int> place;    // whole → part, −1 where it has no element
};

Part part_of(const Model& whole, const std::vector<bool>& keep, bool side) {
    Part part;
    part.model = whole;
    part.place.assign(static_cast<std::size_t>(whole.mesh.node_count()), -1);
    std::vector<int> tets;
    for (int t = 0; t < whole.mesh.tet_count(); ++t) {
        if (keep[static_cast<std::size_t>(t)] != side) continue;
        tets.push_back(t);
        for (const int node : whole.mesh.tets.col(t)) part.place[static_cast<std::size_t>(node)] = 0;
    }
    for (std::size_t node = 0; node < part.place.size(); ++node) {
        if (part.place[node] < 0) continue;
        part.place[node] = static_cast<int>(part.node_of.size());
        part.node_of.push_back(static_cast<int>(node));
    }
    part.model.mesh.nodes = whole.mesh.nodes(Eigen::all, part.node_of);
    part.model.mesh.tets = whole.mesh.tets(Eigen::all, tets);
    for (int& node : part.model.mesh.tets.reshaped()) node = part.place[static_cast<std::size_t>(node)];
    part.model.mesh.labels = whole.mesh.labels(tets);
    if (whole.fibre.cols() > 0) part.model.fibre = whole.fibre(Eigen::all, tets);
    return part;
}

int renumbered(const Part& part, int node) {
    return part.place[static_cast<std::size_t>(node)];
}

/// Faces all of whose nodes are in the part; `outside` counts the others.
Eigen::Matrix3Xi renumbered(const Part& part, const Eigen::Matrix3Xi& faces, int& outside) {
    std::vector<int> nodes;
    for (Eigen::Index f = 0; f < faces.cols(); ++f) {
        const std::array<int, 3> face{renumbered(part, faces(0, f)), renumbered(part, faces(1, f)),
                                      renumbered(part, faces(2, f))};
        if (*std::min_element(face.begin(), face.end()) < 0)
            ++outside;
        else
            nodes.insert(nodes.end(), face.begin(), face.end());
    }
    return Eigen::Map<const Eigen::Matrix3Xi>(nodes.data(), 3, static_cast<Eigen::Index>(nodes.size() / 3));
}

Effects effects_on(const Part& part, const Effects& whole) {
    Effects effects = whole;
    int outside = 0;
    for (SurfacePressure& each : effects.pressures) each.faces = renumbered(part, each.faces, outside);
    for (Membrane& each : effects.membranes) each.faces = renumbered(part, each.faces, outside);
    for (std::vector<SlidingPair>* pairs : {&effects.sliding, &effects.parting})
        for (SlidingPair& pair : *pairs) {
            pair.first = renumbered(part, pair.first);
            pair.second = renumbered(part, pair.second);
            outside += pair.first < 0 || pair.second < 0;
        }
    if (outside > 0)
        throw InvalidInput("the region leaves out " + std::to_string(outside) +
                           " faces or pairs on which a pressure, a membrane or sliding acts: keep the tissue there");
    if (effects.contact) {
        std::vector<int> nodes;
        for (const int node : effects.contact->nodes)
            if (renumbered(part, node) >= 0) nodes.push_back(renumbered(part, node));
        effects.contact->nodes = std::move(nodes);
    }
    return effects;
}

/// The force on every node of the whole that does not depend on the displacement, mN. Lift is taken at rest.
Matrix3Xd constant_force(const RestState& rest, const NodalConditions& conditions) {
    Matrix3Xd force = conditions.external_force;
    if (conditions.effects.fluid) force += fluid_force(*conditions.effects.fluid, Matrix3Xd::Zero(3, rest.node_count));
    return force;
}

/// Springs and prescribed displacements of the part's nodes. External forces are shared out between the parts by mass.
Conditions conditions_on(const Part& part, const Conditions& whole) {
    Conditions result;
    for (Spring spring : whole.springs)
        if ((spring.node = renumbered(part, spring.node)) >= 0) result.springs.push_back(spring);
    for (PrescribedDisplacement prescribed : whole.prescribed)
        if ((prescribed.node = renumbered(part, prescribed.node)) >= 0) result.prescribed.push_back(prescribed);
    return result;
}

/// Of every node of the whole, the part of its mass that the elements of `part` give it.
Eigen::VectorXd mass_share(const Part& part, const RestState& rest, const RestState& rest_of_whole) {
    Eigen::VectorXd share = Eigen::VectorXd::Zero(rest_of_whole.node_count);
    for (std::size_t a = 0; a < part.node_of.size(); ++a)
        share[part.node_of[a]] =
            rest.lumped_mass[static_cast<Eigen::Index>(a)] / rest_of_whole.lumped_mass[part.node_of[a]];
    return share;
}

/// The symmetric positive semi-definite matrix nearest to A.
Matrix3d admissible(const Matrix3d& A) {
    const Eigen::SelfAdjointEigenSolver<Matrix3d> modes(0.5 * (A + A.transpose()));
    return modes.eigenvectors() * modes.eigenvalues().cwiseMax(0.0).asDiagonal() * modes.eigenvectors().transpose();
}

void require_usable(const Model& whole, const std::vector<bool>& keep, const std::vector<int>& targets) {
    if (whole.hexahedra.count() > 0) throw InvalidInput("a region is cut out of tetrahedra: the model has hexahedra");
    if (keep.size() != static_cast<std::size_t>(whole.mesh.tet_count()))
        throw InvalidInput("the region marks " + std::to_string(keep.size()) + " tetrahedra; the model has " +
                           std::to_string(whole.mesh.tet_count()));
    if (std::find(keep.begin(), keep.end(), true) == keep.end())
        throw InvalidInput("the region keeps no tetrahedron: widen it");
    for (const int node : targets)
        if (node < 0 || node >= whole.mesh.node_count())
            throw InvalidInput("a target of the region is node " + std::to_string(node) + "; the mesh has nodes 0 to " +
                               std::to_string(whole.mesh.node_count() - 1));
}

}  // namespace

struct FarTissue::Impl {
    Part near, far;
    RestState whole, rest;       // of all, and of the far part
    Eigen::VectorXd far_share;   // of the mass of every node of the whole
    std::vector<int> interface;  // nodes of the far part that the region has too and nothing prescribes
    std::vector<int> nodes;      // the same, of the whole
    std::optional<RestStiffness> stiffness;

    Impl(const Model& all, const Conditions& conditions, const std::vector<bool>& keep)
        : near(part_of(all, keep, true)), far(part_of(all, keep, false)), whole(rest_state(all)) {
        far_share = Eigen::VectorXd::Ones(whole.node_count) - mass_share(near, rest_state(near.model), whole);
        if (far.node_of.empty()) return;
        rest = rest_state(far.model);
        std::vector<bool> prescribed(far.node_of.size(), false);
        for (const PrescribedDisplacement& each : conditions_on(far, conditions).prescribed)
            prescribed[static_cast<std::size_t>(each.node)] = true;
        for (std::size_t a = 0; a < far.node_of.size(); ++a) {
            if (renumbered(near, far.node_of[a]) < 0 || prescribed[a]) continue;
            interface.push_back(static_cast<int>(a));
            nodes.push_back(far.node_of[a]);
        }
        if (!interface.empty()) stiffness.emplace(rest, held(conditions));
    }

    /// Of the far part, its interface held.
    [[nodiscard]] NodalConditions held(const Conditions& conditions) const {
        Conditions result = conditions_on(far, conditions);
        for (const int a : interface) result.prescribed.push_back({a, {true, true, true}, {0, 0, 0}});
        const Matrix3Xd force = constant_force(whole, nodal_conditions(conditions, whole)) * far_share.asDiagonal();
        result.external_force = force(Eigen::all, far.node_of);
        return nodal_conditions(result, rest.node_count);
    }

    /// Linear-elastic force of the far tissue on the interface nodes under conditions that impose their displacement.
    [[nodiscard]] Matrix3Xd force_on_interface(const NodalConditions& conditions) const {
        const Matrix3Xd u = stiffness->linear_solution(conditions, answer_tolerance);
        return (conditions.external_force - stiffness->elastic_resistance(u))(Eigen::all, interface);
    }
};

FarTissue::FarTissue(const Model& whole, const Conditions& conditions, const std::vector<bool>& keep) {
    require_usable(whole, keep, {});
    impl_ = std::make_unique<Impl>(whole, conditions, keep);
}
FarTissue::~FarTissue() = default;

const std::vector<int>& FarTissue::nodes() const {
    return impl_->nodes;
}

std::vector<Spring> FarTissue::springs(const Conditions& conditions) const {
    const Impl& far = *impl_;
    std::vector<Spring> springs;
    if (far.interface.empty()) return springs;
    NodalConditions moved = far.held(conditions);
    moved.external_force.setZero();
    moved.spring_force.setZero();
    moved.imposed.setZero();
    std::vector<Matrix3d> stiffness(far.interface.size(), Matrix3d::Zero());
    for (int c = 0; c < 3; ++c) {
        for (const int a : far.interface) moved.imposed.col(a) = Vector3d::Unit(c);
        const Matrix3Xd resistance = far.force_on_interface(moved);
        for (std::size_t i = 0; i < stiffness.size(); ++i)
            stiffness[i].col(c) = -resistance.col(static_cast<Eigen::Index>(i));
    }
    for (std::size_t i = 0; i < stiffness.size(); ++i)
        springs.push_back({far.nodes[i], admissible(stiffness[i]), Vector3d::Zero()});
    return springs;
}

Matrix3Xd FarTissue::force(const Conditions& conditions) const {
    if (impl_->interface.empty()) return Matrix3Xd(3, 0);
    return impl_->force_on_interface(impl_->held(conditions));
}

Matrix3Xd linear_answer(const Model& model, const Conditions& conditions) {
    const RestState rest = rest_state(model);
    NodalConditions nodal = nodal_conditions(conditions, rest);
    nodal.external_force = constant_force(rest, nodal) +
                           surface_force(nodal.effects.surface, rest.position, Matrix3Xd::Zero(3, rest.node_count));
    return RestStiffness(rest, nodal).linear_solution(nodal, answer_tolerance);
}

Region region_of(const Model& whole, const Conditions& conditions, const FarTissue& far,
                 const std::vector<int>& targets, const Matrix3Xd& answer) {
    const Part& near = far.impl_->near;
    for (const int node : targets)
        if (renumbered(near, node) < 0)
            throw InvalidInput("target node " + std::to_string(node) + " is outside the region: widen it");

    Region region{near.model, near.node_of, conditions_on(near, conditions), 0.0};
    region.conditions.effects = effects_on(near, conditions.effects);
    const Eigen::VectorXd share = Eigen::VectorXd::Ones(whole.mesh.node_count()) - far.impl_->far_share;
    const Matrix3Xd external = nodal_conditions(conditions, far.impl_->whole).external_force;
    region.conditions.external_force = (external * share.asDiagonal())(Eigen::all, near.node_of);
    const Matrix3Xd force = far.force(conditions);
    for (Spring& spring : far.springs(conditions)) {
        spring.node = renumbered(near, spring.node);
        region.conditions.springs.push_back(spring);
    }
    for (std::size_t i = 0; i < far.nodes().size(); ++i)
        region.conditions.external_force.col(renumbered(near, far.nodes()[i])) +=
            force.col(static_cast<Eigen::Index>(i));

    const Matrix3Xd part = linear_answer(region.model, region.conditions);
    for (const int node : targets)
        region.estimated_change_mm =
            std::max(region.estimated_change_mm, (answer.col(node) - part.col(renumbered(near, node))).norm());
    return region;
}

Region region_of(const Model& whole, const Conditions& conditions, const std::vector<bool>& keep,
                 const std::vector<int>& targets) {
    require_usable(whole, keep, targets);
    return region_of(whole, conditions, FarTissue(whole, conditions, keep), targets, linear_answer(whole, conditions));
}

}  // namespace tissuewarp::tled
