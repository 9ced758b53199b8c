#include "apps/bench_scenes.hpp"

#include "meshing/mesher.hpp"
#include "meshing/primitives.hpp"
#include "study/label_mesh.hpp"
#include "tled/critical_step.hpp"
#include "tled/engine.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tissuewarp::apps {

namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

constexpr double edge = 100;          // mm
constexpr double stretch = 0.2;       // of the edge
constexpr double least_height = 100;  // mm, of what is pressed in by 10 mm; all lengths shrink with a smaller one
constexpr double indentation = 10;    // mm
constexpr double pressed = 15;        // mm, radius of what is pressed in
constexpr double fade = 40;           // mm, standard deviation of the dent around it

BenchScene scene_of(const meshing::TetMesh& mesh, Matrix3Xd start, const tled::Conditions& conditions,
                    tled::Element element = tled::Element::T4) {
    tled::Model model;
    model.mesh = mesh;
    model.materials[1] = tled::NeoHookeanLnJ{1.007, 49.329};
    model.element = element;
    model.density = 1e-6;
    return {tled::rest_state(model), tled::nodal_conditions(conditions, mesh.node_count()), std::move(start)};
}

double highest_step(const BenchScene& scene, const tled::NodalConditions& conditions, const Matrix3Xd& displacement) {
    const auto engine = tled::make_cpu_engine(scene.rest, tled::Scalar::Float64);
    engine->set_conditions(conditions);
    return 2 / std::sqrt(tled::highest_mode(*engine, scene.mass(), displacement).eigenvalue);
}

double critical_step_at_rest(const BenchScene& scene) {
    tled::NodalConditions held = scene.conditions;
    held.imposed.setZero();
    return highest_step(scene, held, Matrix3Xd::Zero(3, scene.rest.node_count));
}

/// Lets the pressure of the start go in heavily damped steps: as waves, no step near the critical one survives it.
void settle(BenchScene& scene) {
    constexpr double damping = 0.2;  // α Δt/2
    constexpr int steps = 400;
    const double step = 0.3 * critical_step_at_rest(scene);
    const auto engine = tled::make_cpu_engine(scene.rest, tled::Scalar::Float64);
    engine->set_conditions(scene.conditions);
    engine->set_state(scene.start, Matrix3Xd::Zero(3, scene.rest.node_count));
    engine->run(steps, {(1 - damping) / (1 + damping), step * step / (1 + damping)});
    scene.start = engine->displacement();
}

}  // namespace

int cells_for(int elements) {
    return std::max(1, static_cast<int>(std::lround(std::cbrt(elements / 6.0))));
}

BenchScene stretched_cube(int cells, tled::Element element) {
    const meshing::TetMesh mesh = meshing::box_mesh({edge, edge, edge}, {cells, cells, cells});
    Matrix3Xd start(3, mesh.node_count());
    tled::Conditions conditions;
    for (int node = 0; node < mesh.node_count(); ++node) {
        const Vector3d X = mesh.nodes.col(node);
        const double z = X.z() / edge, turn = 2 * std::numbers::pi * z;
        const double across = 1 / std::sqrt(1 + stretch * (1 - std::cos(turn)));  // one over the root of ∂z/∂Z
        start.col(node) << (across - 1) * (X.x() - edge / 2), (across - 1) * (X.y() - edge / 2),
            stretch * (X.z() - edge / (2 * std::numbers::pi) * std::sin(turn));
        if (z < 1e-6 || z > 1 - 1e-6) conditions.prescribed.push_back({node, {true, true, true}, start.col(node)});
    }
    return scene_of(mesh, std::move(start), conditions, element);
}

BenchScene indented_brain(const meshing::TetMesh& mesh) {
    const Vector3d outward(0, -0.8, 0.6);  // LPS: to the front and above
    const meshing::BoundarySurface boundary = meshing::boundary_surface(mesh);
    int centre = boundary.node_of.front();
    for (const int node : boundary.node_of)
        if (outward.dot(mesh.nodes.col(node) - mesh.nodes.col(centre)) > 0) centre = node;
    const double low = mesh.nodes.row(2).minCoeff(), height = mesh.nodes.row(2).maxCoeff() - low;

    const double anchored = low + 0.1 * height;
    const double scale = std::min(1.0, height / least_height);
    Matrix3Xd start(3, mesh.node_count());
    for (int node = 0; node < mesh.node_count(); ++node) {
        const double beyond = std::max(0.0, (mesh.nodes.col(node) - mesh.nodes.col(centre)).norm() - scale * pressed);
        const double above = std::clamp((mesh.nodes(2, node) - anchored) / (0.4 * height), 0.0, 1.0);
        start.col(node) =
            -indentation * scale * above * std::exp(-0.5 * std::pow(beyond / (scale * fade), 2)) * outward;
    }
    tled::Conditions conditions;
    for (int node = 0; node < mesh.node_count(); ++node)
        if (mesh.nodes(2, node) < anchored)
            conditions.prescribed.push_back({node, {true, true, true}, Vector3d::Zero()});
    for (const int node : boundary.node_of)
        if ((mesh.nodes.col(node) - mesh.nodes.col(centre)).norm() < scale * pressed && mesh.nodes(2, node) >= anchored)
            conditions.prescribed.push_back({node, {true, true, true}, start.col(node)});
    BenchScene scene = scene_of(mesh, std::move(start), conditions);
    settle(scene);
    return scene;
}

meshing::TetMesh brain_mesh(const imaging::Volume& label_map, const std::vector<int>& labels, int elements,
                            Observer& observer) {
    constexpr int tries = 5;
    constexpr double accepted = 0.03;
    const imaging::Volume tissue = study::one_tissue(label_map, labels);
    meshing::MeshingOptions options;
    options.edge_length = study::edge_length_for(tissue, elements);  // too large: edges are shorter at the surface
    meshing::TetMesh best;
    const auto error = [&](const meshing::TetMesh& mesh) { return std::abs(double(mesh.tet_count()) / elements - 1); };
    for (int i = 0; i < tries && (i == 0 || error(best) > accepted); ++i) {
        meshing::TetMesh mesh = meshing::mesh_labels(tissue, options, observer);
        options.edge_length *= std::cbrt(double(mesh.tet_count()) / elements);
        if (i == 0 || error(mesh) < error(best)) best = std::move(mesh);
    }
    return best;
}

double critical_step(const BenchScene& scene) {
    return std::min(critical_step_at_rest(scene), highest_step(scene, scene.conditions, scene.start));
}

}  // namespace tissuewarp::apps
