#include "simulation/plan.hpp"

#include "tled/critical_step.hpp"
#include "tled/step_work.hpp"

#include <algorithm>
#include <set>

namespace tissuewarp::simulation {

namespace {

constexpr double vector_bytes = 12;  // three float32

std::string count(Eigen::Index n, const std::string& what) {
    return std::to_string(n) + " " + what;
}

Work times(double n, const Work& each) {
    return {n * each.bytes, n * each.flops};
}

// Positions of three nodes read, three forces left; edges, normal and scale.
constexpr Work pressure_of_face{6 * vector_bytes, 6 + 9 + 3};
// The same with D⁻¹ and the stiffness read; F, C, its inverse, P and the forces.
constexpr Work membrane_of_face{6 * vector_bytes + 16, 6 + 18 + 15 + 24 + 24 + 24};
// Two displacements read, two forces left, normal and stiffness; the gap and its pull.
constexpr Work sliding_of_pair{4 * vector_bytes + 16, 3 + 5 + 1 + 9};
// Height, weight, column; the immersion.
constexpr Work fluid_of_node{12, 5 + 4 + 10 + 3};
// Rest position and 64 samples with their gradient; weights of three axes.
constexpr Work contact_of_node{vector_bytes + 64 * 4, 64 * 8 + 3 * 30};

void add_loads(const BuiltScene& built, std::vector<PlannedEffect>& all) {
    const Scene& scene = built.scene;
    int fixed = 0, moved = 0;
    for (const HeldNode& held : built.held) {
        bool moves = false;
        for (const int motion : held.motion) moves = moves || motion >= 0;
        (moves ? moved : fixed) += 1;
    }
    if (fixed > 0) all.push_back({"fixed", count(fixed, "nodes"), {}});
    if (moved > 0) all.push_back({"motion", count(moved, "nodes"), {}});
    std::set<int> nodes;
    for (const tled::Spring& spring : built.springs) nodes.insert(spring.node);
    if (!nodes.empty())
        all.push_back({"springs", count(static_cast<Eigen::Index>(nodes.size()), "nodes"),
                       times(static_cast<double>(nodes.size()), {36 + 4, 18})});
    if (scene.gravity)
        all.push_back({"gravity", scene.gravity->from ? "turns, from the image's direction" : "grows", {}});
    for (const Eigen::Matrix3Xi& faces : built.traction_faces)
        all.push_back({"traction", count(faces.cols(), "faces"), {}});
    for (const auto& [label, tissue] : scene.tissues)
        if (!tissue.viscosity.terms.empty() && scene.solve.kind == Solve::Kind::Dynamics) {
            const auto tets = static_cast<double>((built.stages.front().model.mesh.labels.array() == label).count());
            const auto terms = static_cast<double>(tissue.viscosity.terms.size());
            all.push_back({"viscosity",
                           "label " + std::to_string(label) + ", " + count(static_cast<Eigen::Index>(terms), "terms"),
                           times(tets * terms, {48, 6 * 4})});
        }
}

void add_effects(const BuiltScene& built, std::vector<PlannedEffect>& all) {
    const tled::Effects& effects = built.effects;
    if (effects.fluid)
        all.push_back({"fluid", count(built.stages.front().model.mesh.node_count(), "nodes"),
                       times(built.stages.front().model.mesh.node_count(), fluid_of_node)});
    const auto faces = [&](const char* name, const Eigen::Matrix3Xi& list, const Work& each) {
        all.push_back({name, count(list.cols(), "faces"), times(static_cast<double>(list.cols()), each)});
    };
    for (const tled::SurfacePressure& each : effects.pressures) faces("pressure", each.faces, pressure_of_face);
    for (const tled::Membrane& each : effects.membranes) faces("membrane", each.faces, membrane_of_face);
    const auto pairs = [&](const char* name, const std::vector<tled::SlidingPair>& list) {
        if (list.empty()) return;
        all.push_back({name, count(static_cast<Eigen::Index>(list.size()), "pairs of nodes"),
                       times(static_cast<double>(list.size()), sliding_of_pair)});
    };
    pairs("sliding", effects.sliding);
    pairs("parting", effects.parting);
    if (!effects.contact) return;
    std::set<int> nodes(effects.contact->nodes.begin(), effects.contact->nodes.end());
    const auto bodies = effects.contact->obstacles.size();
    const auto turning = std::count_if(built.scene.contacts.begin(), built.scene.contacts.end(),
                                       [](const Contact& each) { return !each.motion.turn.isZero(0.0); });
    all.push_back(
        {"contact",
         count(static_cast<Eigen::Index>(nodes.size()), "nodes with ") +
             count(static_cast<Eigen::Index>(bodies), bodies == 1 ? "body" : "bodies") +
             (turning > 0 ? ", of which " + std::to_string(turning) + (turning == 1 ? " turns" : " turn") : ""),
         times(static_cast<double>(nodes.size() * bodies), contact_of_node)});
}

double memory_of(const BuiltScene& built) {
    const tled::RestState& rest = built.stages.front().rest;
    // Nodes: X, u, u − u⁻, 1/m, load and mask; elements: nodes, ∇N, volume, modulus; lists of both.
    double bytes = rest.node_count * 6 * vector_bytes + rest.element_count() * (16 + 36 + 8 + 16);
    bytes += static_cast<double>(rest.pressure.count()) * 16;
    for (const auto& [label, series] : built.stages.front().model.viscosity)
        bytes += 24.0 * static_cast<double>(series.terms.size()) *
                 static_cast<double>((built.stages.front().model.mesh.labels.array() == label).count());
    if (built.effects.contact)
        for (const tled::Obstacle& obstacle : built.effects.contact->obstacles)
            bytes += 4.0 * static_cast<double>(obstacle.surface->distance.size());
    return bytes;
}

std::string law_of(int label, const Tissue& tissue) {
    std::string text = "label " + std::to_string(label) + (tissue.name.empty() ? "" : ", " + tissue.name) + ": " +
                       tled::law_name(tissue.material);
    if (std::holds_alternative<FibreVolume>(tissue.fibres)) text += ", fibres from a volume";
    if (std::holds_alternative<FibresOfTetrahedra>(tissue.fibres)) text += ", fibres of each tetrahedron";
    if (!tissue.viscosity.terms.empty())
        text += ", viscous with " + std::to_string(tissue.viscosity.terms.size()) + " terms";
    if (tissue.growth != 1.0) text += ", grown by " + std::to_string(tissue.growth);
    return text;
}

}  // namespace

Plan plan_of(const BuiltScene& built) {
    const Stage& stage = built.stages.front();
    Plan plan;
    plan.nodes = stage.rest.node_count;
    plan.tetrahedra = stage.rest.element_count();
    plan.outer_faces = meshing::boundary_surface(stage.model.mesh).surface.triangle_count();
    plan.element =
        stage.model.element == tled::Element::T4 ? "linear tetrahedra" : "linear tetrahedra with averaged pressure";
    for (const auto& [label, tissue] : built.scene.tissues) plan.laws.push_back(law_of(label, tissue));
    const auto whole = [&](const tled::StepWork& each) { return times(plan.tetrahedra, {each.bytes, each.flops}); };
    plan.cpu = whole(tled::cpu_step_work(stage.rest));
    plan.gpu =
        whole(tled::gpu_step_work(stage.rest, tled::suggested_gpu_step_shape(plan.tetrahedra, stage.model.element)));
    add_loads(built, plan.effects);
    add_effects(built, plan.effects);
    plan.memory = memory_of(built);
    if (built.scene.solve.kind == Solve::Kind::Dynamics)
        plan.time_step = 0.9 * tled::element_step_bounds(stage.rest, stage.model.density).minCoeff();
    return plan;
}

}  // namespace tissuewarp::simulation
