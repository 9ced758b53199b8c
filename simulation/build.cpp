#include "simulation/build.hpp"

#include "core/errors.hpp"
#include "simulation/geometry.hpp"
#include "simulation/obstacles.hpp"
#include "simulation/region.hpp"
#include "tled/growth.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <map>
#include <string>

namespace tissuewarp::simulation {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix3Xi;
using Eigen::Vector3d;

/// Of each tetrahedron, 3 × M; empty where no tissue has fibres that vary.
Eigen::Matrix3Xd fibre_directions(const Scene& scene, const meshing::TetMesh& mesh) {
    const auto vary = [](const auto& tissue) { return tissue.second.fibres.index() != 0; };
    if (std::none_of(scene.tissues.begin(), scene.tissues.end(), vary)) return {};
    Eigen::Matrix3Xd fibres = Vector3d::UnitZ().replicate(1, mesh.tet_count());  // where no law asks for one
    for (const auto& [label, tissue] : scene.tissues) {
        const auto* law = std::get_if<tled::TransverselyIsotropic>(&tissue.material);
        if (!law) continue;
        Eigen::Matrix3Xd own = law->fibre.replicate(1, mesh.tet_count());
        if (const auto* volume = std::get_if<FibreVolume>(&tissue.fibres)) own = fibres_of(*volume, mesh, label);
        if (const auto* given = std::get_if<FibresOfTetrahedra>(&tissue.fibres)) own = fibres_of(*given, mesh, label);
        for (int e = 0; e < mesh.tet_count(); ++e)
            if (mesh.labels[e] == label) fibres.col(e) = own.col(e);
    }
    return fibres;
}

tled::Model model_of(const Scene& scene, const meshing::TetMesh& mesh) {
    tled::Model model;
    model.mesh = mesh;
    for (const auto& [label, tissue] : scene.tissues) {
        model.materials[label] = tissue.material;
        if (!tissue.viscosity.terms.empty()) model.viscosity[label] = tissue.viscosity;
    }
    model.density = scene.density;
    model.fibre = fibre_directions(scene, mesh);
    model.element = scene.solve.element.value_or(tled::suggested_element(model.materials));
    return model;
}

/// Pairs that hold together, and that may part.
struct Interfaces {
    std::vector<tled::SlidingPair> held, free;
};

tled::InterfaceSides sides_of(const Sliding& sliding, const Scene& scene, const tled::TissueMesh& tissue) {
    if (!sliding.sets) return tled::sides_of_labels(tissue, sliding.labels);
    const RegionFinder finder(tissue, scene.sets);
    return {finder.tets((*sliding.sets)[0]), finder.tets((*sliding.sets)[1]), simulation::sides_of(sliding)};
}

Interfaces open_interfaces(const Scene& scene, tled::TissueMesh& tissue) {
    Interfaces interfaces;
    for (const Sliding& sliding : scene.sliding) {
        std::vector<int> joined;
        if (!sliding.except.empty()) joined = RegionFinder(tissue, scene.sets).nodes(sliding.except);
        auto& pairs = sliding.opening == Sliding::Opening::Held ? interfaces.held : interfaces.free;
        const auto more = tled::open_interface(tissue, sides_of(sliding, scene, tissue), joined, sliding.per_area);
        pairs.insert(pairs.end(), more.begin(), more.end());
    }
    return interfaces;
}

/// Only one may hold or move a component; fixing it twice is the same as once.
void hold(std::map<int, HeldNode>& held, const std::vector<int>& nodes, const std::array<bool, 3>& axes, int motion,
          const std::string& set) {
    for (const int node : nodes) {
        HeldNode& entry = held[node];
        entry.node = node;
        for (std::size_t axis = 0; axis < 3; ++axis) {
            if (!axes[axis]) continue;
            if (entry.motion[axis] != HeldNode::none && entry.motion[axis] != motion)
                throw InvalidInput("the " + std::string(1, "xyz"[axis]) + " component of node " + std::to_string(node) +
                                   " of the set '" + set +
                                   "' is already held or moved by another; let the sets differ, by 'without'");
            entry.motion[axis] = motion;
        }
    }
}

std::vector<HeldNode> held_nodes(const Scene& scene, const RegionFinder& finder) {
    std::map<int, HeldNode> held;
    for (const Fixed& fixed : scene.fixed) hold(held, finder.nodes(fixed.set), fixed.axes, HeldNode::fixed, fixed.set);
    for (std::size_t m = 0; m < scene.motions.size(); ++m)
        hold(held, finder.nodes(scene.motions[m].set), scene.motions[m].axes, static_cast<int>(m),
             scene.motions[m].set);
    std::vector<HeldNode> list;
    for (const auto& [node, entry] : held) list.push_back(entry);
    return list;
}

/// Unit normals of the faces at their nodes, by node of the mesh.
Eigen::Matrix3Xd normals_of(const meshing::TetMesh& mesh, const Matrix3Xi& faces) {
    return meshing::node_normals({mesh.nodes, faces});
}

void add_springs(const Springs& springs, const meshing::TetMesh& mesh, const RegionFinder& finder,
                 std::vector<tled::Spring>& all) {
    const bool on_faces = springs.per_area > 0 || springs.along == Springs::Along::Normal;
    const Matrix3Xi faces = on_faces ? finder.faces(springs.set) : Matrix3Xi(3, 0);
    const std::vector<int> nodes = finder.nodes(springs.set);
    const Eigen::VectorXd area = nodal_areas(mesh, faces);
    const Eigen::Matrix3Xd normal = normals_of(mesh, faces);
    for (const int node : nodes) {
        const double stiffness =
            springs.per_area > 0 ? springs.per_area * area[node] : springs.total / static_cast<double>(nodes.size());
        const Matrix3d directions = springs.along == Springs::Along::Normal
                                        ? Matrix3d(normal.col(node) * normal.col(node).transpose())
                                        : Matrix3d(Matrix3d::Identity());
        if (stiffness > 0 && directions.norm() > 0) all.push_back({node, stiffness * directions, Vector3d::Zero()});
    }
}

/// By how much a mesh may stand out of the labels that it was made of, mm.
double overlap_of(const Scene& scene, const meshing::TetMesh& mesh) {
    if (const imaging::Volume* labels = label_volume(scene)) return 1.5 * labels->geometry.spacing.maxCoeff();
    return 1e-3 * (mesh.nodes.rowwise().maxCoeff() - mesh.nodes.rowwise().minCoeff()).norm();
}

tled::RigidContact contact_of(const Scene& scene, const meshing::TetMesh& mesh, const RegionFinder& finder,
                              Observer& observer) {
    tled::RigidContact contact;
    const Matrix3Xi outer = finder.outer_faces();
    std::vector<int> surface(outer.reshaped().begin(), outer.reshaped().end());
    std::sort(surface.begin(), surface.end());
    surface.erase(std::unique(surface.begin(), surface.end()), surface.end());
    for (const Contact& each : scene.contacts) {
        const std::vector<int> nodes = each.set.empty() ? surface : finder.nodes(each.set);
        contact.nodes.insert(contact.nodes.end(), nodes.begin(), nodes.end());
        contact.obstacles.push_back(
            obstacle(each, mesh.nodes(Eigen::all, nodes), overlap_of(scene, mesh), label_volume(scene), observer));
        observer.checkpoint("building the scene", 0.5);
    }
    return contact;
}

tled::Effects effects_of(const Scene& scene, const meshing::TetMesh& mesh, const RegionFinder& finder,
                         Interfaces interfaces, Observer& observer) {
    tled::Effects effects;
    for (const Pressure& pressure : scene.pressures)
        effects.pressures.push_back({finder.faces(pressure.set), pressure.pressure});
    for (const MembraneOn& membrane : scene.membranes)
        effects.membranes.push_back({finder.faces(membrane.set), membrane.shear_modulus, membrane.thickness});
    effects.sliding = std::move(interfaces.held);
    effects.parting = std::move(interfaces.free);
    if (scene.fluid) effects.fluid = tled::Fluid{scene.fluid->density, Vector3d::Zero(), scene.fluid->to};
    if (!scene.contacts.empty()) effects.contact = contact_of(scene, mesh, finder, observer);
    return effects;
}

std::vector<meshing::Location> located(const std::vector<Probe>& probes, const meshing::TetMesh& mesh) {
    const meshing::PointLocator locator(mesh);
    std::vector<meshing::Location> locations;
    for (const Probe& probe : probes) {
        const auto found = locator.find(probe.at, 1e-6);
        if (!found) {
            const double distance = (mesh.nodes.colwise() - probe.at).colwise().norm().minCoeff();
            throw InvalidInput("the probe '" + probe.name + "' lies outside the tissue, " + std::to_string(distance) +
                               " mm from its nearest node; give a point of the tissue at rest");
        }
        locations.push_back(*found);
    }
    return locations;
}

void grow(Stage& stage, const Scene& scene) {
    std::map<int, double> stretch;
    for (const auto& [label, tissue] : scene.tissues)
        if (tissue.growth != 1.0 && (stage.model.mesh.labels.array() == label).any()) stretch[label] = tissue.growth;
    if (stretch.empty()) return;
    tled::Grown grown = tled::grown(stage.model, stretch);
    stage.model = std::move(grown.model);
    stage.growth = std::move(grown.pressures);
}

/// What is left of a model when these tetrahedra are gone.
Stage remaining(const tled::Model& model, const Scene& scene, const std::vector<bool>& gone, double begin) {
    Stage stage;
    stage.begin = begin;
    stage.model = model;
    const meshing::TetMesh& mesh = model.mesh;
    stage.place.assign(static_cast<std::size_t>(mesh.node_count()), -1);
    for (int e = 0; e < mesh.tet_count(); ++e) {
        if (gone[static_cast<std::size_t>(e)]) continue;
        stage.tet.push_back(e);
        for (const int node : mesh.tets.col(e)) stage.place[static_cast<std::size_t>(node)] = 0;
    }
    if (stage.tet.empty()) throw InvalidInput("the resections leave no tissue");
    for (std::size_t n = 0; n < stage.place.size(); ++n)
        if (stage.place[n] == 0) {
            stage.place[n] = static_cast<int>(stage.node.size());
            stage.node.push_back(static_cast<int>(n));
        }
    meshing::TetMesh& left = stage.model.mesh;
    left.nodes = Eigen::Matrix3Xd(mesh.nodes(Eigen::all, stage.node));
    left.tets = Eigen::Matrix4Xi(mesh.tets(Eigen::all, stage.tet));
    left.labels = Eigen::VectorXi(mesh.labels(stage.tet));
    if (model.fibre.size() > 0) stage.model.fibre = Eigen::Matrix3Xd(model.fibre(Eigen::all, stage.tet));
    for (int& node : left.tets.reshaped()) node = stage.place[static_cast<std::size_t>(node)];
    grow(stage, scene);
    if (scene.solve.kind == Solve::Kind::Equilibrium) stage.model = tled::relaxed(stage.model);
    stage.rest = tled::rest_state(stage.model);
    return stage;
}

std::vector<Stage> stages_of(const Scene& scene, const meshing::TetMesh& mesh, const RegionFinder& finder) {
    const tled::Model whole = model_of(scene, mesh);
    std::vector<bool> gone(static_cast<std::size_t>(mesh.tet_count()), false);
    std::vector<Stage> stages{remaining(whole, scene, gone, 0.0)};
    std::vector<Resection> resections = scene.resections;
    std::stable_sort(resections.begin(), resections.end(),
                     [](const Resection& a, const Resection& b) { return a.time < b.time; });
    for (std::size_t r = 0; r < resections.size(); ++r) {
        for (const int tet : finder.tets(resections[r].set)) gone[static_cast<std::size_t>(tet)] = true;
        if (r + 1 < resections.size() && resections[r + 1].time == resections[r].time) continue;
        stages.push_back(remaining(whole, scene, gone, resections[r].time));
    }
    return stages;
}

}  // namespace

BuiltScene build(const Scene& scene, Observer& observer) {
    require_valid(scene);
    return build(scene, mesh_of(scene, observer), observer);
}

BuiltScene build(const Scene& scene, const meshing::TetMesh& mesh, Observer& observer) {
    require_valid(scene);
    BuiltScene built;
    built.scene = scene;
    tled::TissueMesh tissue = tled::closed(mesh);
    Interfaces interfaces = open_interfaces(scene, tissue);
    const RegionFinder finder(tissue, scene.sets);
    built.held = held_nodes(scene, finder);
    for (const Springs& springs : scene.springs) add_springs(springs, tissue.mesh, finder, built.springs);
    for (const Traction& each : scene.tractions) built.traction_faces.push_back(finder.faces(each.set));
    built.effects = effects_of(scene, tissue.mesh, finder, std::move(interfaces), observer);
    built.probes = located(scene.probes, tissue.mesh);
    built.mesh = tissue.mesh;
    built.stages = stages_of(scene, tissue.mesh, finder);
    return built;
}

}  // namespace tissuewarp::simulation
