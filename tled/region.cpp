#include "tled/region.hpp"

#include "core/errors.hpp"
#include "tled/reference.hpp"
#include "tled/rest_stiffness.hpp"

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
    for (SlidingPair& pair : effects.sliding) {
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

/// What the tissue left out does to the nodes where it meets the region.
class FarTissue {
public:
    FarTissue(const Part& far, const Part& near, const Conditions& whole, const Matrix3Xd& force)
        : far_(far), rest_(rest_state(far.model)), conditions_(conditions_on(far, whole)) {
        std::vector<bool> prescribed(far.node_of.size(), false);
        for (const PrescribedDisplacement& each : conditions_.prescribed)
            prescribed[static_cast<std::size_t>(each.node)] = true;
        for (std::size_t a = 0; a < far.node_of.size(); ++a) {
            if (renumbered(near, far.node_of[a]) < 0 || prescribed[a]) continue;
            interface_.push_back(static_cast<int>(a));
            conditions_.prescribed.push_back({static_cast<int>(a), {true, true, true}, {0, 0, 0}});
        }
        conditions_.external_force = force;
        loaded_ = nodal_conditions(conditions_, rest_.node_count);
        if (!interface_.empty()) stiffness_.emplace(rest_, loaded_);
    }

    /// Adds springs and forces to the region's conditions.
    void act_on(const Part& near, Conditions& conditions) const {
        if (interface_.empty()) return;
        const Matrix3Xd held = force_on_interface(loaded_);
        NodalConditions moved = loaded_;
        moved.external_force.setZero();
        moved.spring_force.setZero();
        moved.imposed.setZero();
        std::vector<Matrix3d> stiffness(interface_.size(), Matrix3d::Zero());
        for (int c = 0; c < 3; ++c) {
            for (const int a : interface_) moved.imposed.col(a) = Vector3d::Unit(c);
            const Matrix3Xd resistance = force_on_interface(moved);
            for (std::size_t i = 0; i < interface_.size(); ++i)
                stiffness[i].col(c) = -resistance.col(static_cast<Eigen::Index>(i));
        }
        for (std::size_t i = 0; i < interface_.size(); ++i) {
            const int node = renumbered(near, far_.node_of[static_cast<std::size_t>(interface_[i])]);
            conditions.springs.push_back({node, admissible(stiffness[i]), Vector3d::Zero()});
            conditions.external_force.col(node) += held.col(static_cast<Eigen::Index>(i));
        }
    }

private:
    /// Linear-elastic force of the far tissue on the interface nodes under conditions that impose their displacement.
    [[nodiscard]] Matrix3Xd force_on_interface(const NodalConditions& conditions) const {
        const Matrix3Xd u = stiffness_->linear_solution(conditions);
        constexpr double small = 1e-6;  // of the displacement: forces are linear in it
        const Matrix3Xd elastic = internal_force(rest_, small * u) / small;
        Matrix3Xd force(3, static_cast<Eigen::Index>(interface_.size()));
        for (std::size_t i = 0; i < interface_.size(); ++i)
            force.col(static_cast<Eigen::Index>(i)) =
                conditions.external_force.col(interface_[i]) - elastic.col(interface_[i]);
        return force;
    }

    const Part& far_;
    RestState rest_;
    Conditions conditions_;
    NodalConditions loaded_;
    std::vector<int> interface_;  // nodes of the far part that the region has too, and that nothing prescribes
    std::optional<RestStiffness> stiffness_;
};

/// Linear-elastic displacement; lift at rest.
Matrix3Xd linear_answer(const Model& model, const Conditions& conditions) {
    const RestState rest = rest_state(model);
    NodalConditions nodal = nodal_conditions(conditions, rest);
    nodal.external_force = constant_force(rest, nodal) +
                           surface_force(nodal.effects.surface, rest.position, Matrix3Xd::Zero(3, rest.node_count));
    return RestStiffness(rest, nodal).linear_solution(nodal);
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

Region region_of(const Model& whole, const Conditions& conditions, const std::vector<bool>& keep,
                 const std::vector<int>& targets) {
    require_usable(whole, keep, targets);
    const Part near = part_of(whole, keep, true), far = part_of(whole, keep, false);
    for (const int node : targets)
        if (renumbered(near, node) < 0)
            throw InvalidInput("target node " + std::to_string(node) + " is outside the region: widen it");

    const RestState rest = rest_state(whole), rest_of_near = rest_state(near.model);
    const NodalConditions nodal = nodal_conditions(conditions, rest);
    const Eigen::VectorXd share = mass_share(near, rest_of_near, rest);
    Region region{near.model, near.node_of, conditions_on(near, conditions), 0.0};
    region.conditions.effects = effects_on(near, conditions.effects);
    region.conditions.external_force = (nodal.external_force * share.asDiagonal())(Eigen::all, near.node_of);
    if (!far.node_of.empty()) {
        const Matrix3Xd on_far = constant_force(rest, nodal) * (1 - share.array()).matrix().asDiagonal();
        FarTissue(far, near, conditions, on_far(Eigen::all, far.node_of)).act_on(near, region.conditions);
    }

    const Matrix3Xd all = linear_answer(whole, conditions), part = linear_answer(region.model, region.conditions);
    for (const int node : targets)
        region.estimated_change_mm =
            std::max(region.estimated_change_mm, (all.col(node) - part.col(renumbered(near, node))).norm());
    return region;
}

}  // namespace tissuewarp::tled
