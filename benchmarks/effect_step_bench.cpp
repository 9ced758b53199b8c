// What effects cost a step: each alone and typical pairs, as a ratio to the same scene without. The cube of
// benchmarks/stretched_cube.hpp, compressed by 10 % so that its sides bulge, and everything over its whole surface.
//     effect_step_bench [--device N] [--cells 24,55] [--element t4|averaged] [--law lnj|iso] [--engines
//     cpu,gpu,two-passes]
//                       [--rounds N] [--seconds S] [--approach N] [--mesh FILE.vtu] [--only TEXT]
// Without options 24 and 55 cells an edge (82 944 and 998 250 tetrahedra), both elements, law iso, and the CPU engine,
// the GPU's as it comes and the GPU's two passes. The tissue takes --approach steps (400) with its effects, so that it
// lies against obstacles; from there each round times plain steps and steps with effects one after the other, for
// --seconds (0.3) each, and the median of the ratios of --rounds (9) rounds is printed. --only takes the effects whose
// names hold TEXT.

#include "benchmarks/stretched_cube.hpp"
#include "core/errors.hpp"
#include "meshing/mesh_io.hpp"
#include "meshing/primitives.hpp"
#include "tled/model/internal_force.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <sstream>
#include <string>
#include <vector>

using namespace tissuewarp;
using namespace tissuewarp::stretched_cube;
using Eigen::Matrix3Xd;
using Eigen::Matrix3Xi;
using Eigen::Vector3d;

namespace {

struct Options {
    int device = -1;
    std::vector<int> cells{24, 55};
    std::vector<std::string> engines{"cpu", "gpu", "two-passes"};
    std::string element, law = "iso", mesh, only;
    int rounds = 9;
    int approach = 400;
    double seconds = 0.3;
};

Matrix3Xi boundary_faces(const meshing::TetMesh& mesh) {
    const meshing::BoundarySurface boundary = meshing::boundary_surface(mesh);
    Matrix3Xi faces = boundary.surface.triangles;
    for (int& node : faces.reshaped()) node = boundary.node_of[static_cast<std::size_t>(node)];
    return faces;
}

std::vector<int> nodes_of(const Matrix3Xi& faces) {
    std::vector<int> nodes(faces.reshaped().begin(), faces.reshaped().end());
    std::sort(nodes.begin(), nodes.end());
    nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
    return nodes;
}

/// Samples every 2.5 mm over the cube and 25 mm around it.
tled::Obstacle obstacle(const std::function<double(const Vector3d&)>& distance, double friction) {
    tled::DistanceGrid grid;
    grid.steps *= 2.5;
    grid.origin.setConstant(-25);
    grid.size.setConstant(61);
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i)
                grid.distance.push_back(static_cast<float>(distance(grid.origin + grid.steps * Vector3d(i, j, k))));
    return {std::move(grid), {}, friction};
}

/// Beside the face x = edge: a wall, or a ball half as wide as the cube.
tled::Obstacle wall(double friction) {
    return obstacle([](const Vector3d& x) { return edge + 0.01 - x[0]; }, friction);
}
tled::Obstacle ball() {
    const Vector3d centre(edge + 25.01, edge / 2, edge / 2);
    return obstacle([&](const Vector3d& x) { return (x - centre).norm() - 25; }, 0.0);
}

/// Once round in 6 s about the normal of the face.
tled::Obstacle turning_about_its_middle(tled::Obstacle wall) {
    wall.velocity.spin = {1, 0, 0};
    wall.velocity.of_origin = -wall.velocity.spin.cross(Vector3d(edge, edge / 2, edge / 2));
    return wall;
}

/// Neighbours on the face x = edge in pairs: what they cost does not depend on where they lie.
std::vector<tled::SlidingPair> pairs_on_a_face(const meshing::TetMesh& mesh, const std::vector<int>& boundary) {
    std::vector<int> face;
    for (const int node : boundary)
        if (mesh.nodes(0, node) > 0.99 * edge) face.push_back(node);
    std::vector<tled::SlidingPair> pairs;
    for (std::size_t i = 0; i + 1 < face.size(); i += 2)
        pairs.push_back({face[i], face[i + 1], Vector3d::UnitX(), 1.0});
    return pairs;
}

struct Case {
    std::string name;
    tled::Effects effects;
};

std::vector<Case> cases(const meshing::TetMesh& mesh) {
    const Matrix3Xi faces = boundary_faces(mesh);
    const std::vector<int> boundary = nodes_of(faces);
    tled::Effects pressure, membrane, sliding, parting, fluid, touching_wall, rough_wall, turning_wall, touching_ball;
    pressure.pressures = {{faces, 0.05}};
    membrane.membranes = {{faces, 5.0, 0.5}};
    sliding.sliding = pairs_on_a_face(mesh, boundary);
    parting.parting = sliding.sliding;
    // A tenth of water's density, because nothing weighs the cube down.
    fluid.fluid = tled::Fluid{1e-7, {0, 0, -9810}, edge / 2};
    touching_wall.contact = tled::RigidContact{boundary, {wall(0.0)}};
    rough_wall.contact = tled::RigidContact{boundary, {wall(0.3)}};
    turning_wall.contact = tled::RigidContact{boundary, {turning_about_its_middle(wall(0.3))}};
    touching_ball.contact = tled::RigidContact{boundary, {ball()}};
    const auto both = [](tled::Effects one, const tled::Effects& other) {
        if (!other.pressures.empty()) one.pressures = other.pressures;
        if (!other.membranes.empty()) one.membranes = other.membranes;
        if (!other.sliding.empty()) one.sliding = other.sliding;
        if (!other.parting.empty()) one.parting = other.parting;
        if (other.fluid) one.fluid = other.fluid;
        if (other.contact) one.contact = other.contact;
        return one;
    };
    return {{"none (the ratio's own noise)", {}},
            {"fluid", fluid},
            {"contact, wall", touching_wall},
            {"contact, wall with friction", rough_wall},
            {"contact, wall with friction that turns", turning_wall},
            {"contact, ball", touching_ball},
            {"pressure", pressure},
            {"membrane", membrane},
            {"sliding pairs", sliding},
            {"pairs that may part", parting},
            {"fluid, contact", both(fluid, touching_wall)},
            {"pressure, contact", both(pressure, touching_wall)},
            {"membrane, contact", both(membrane, touching_wall)},
            {"pressure, membrane", both(pressure, membrane)},
            {"all", both(both(both(fluid, turning_wall), both(pressure, membrane)), both(sliding, parting))}};
}

/// Nodes on an obstacle's surface, which the table shows so that no contact is timed that does not take place.
int touching(const tled::NodalConditions& conditions, const Matrix3Xd& u) {
    int count = 0;
    if (!conditions.effects.contact) return count;
    const tled::NodalContact& contact = *conditions.effects.contact;
    for (std::size_t i = 0; i < contact.node.size(); ++i)
        for (const tled::Obstacle& body : contact.obstacles)
            if (tled::distance_to(body,
                                  contact.rest_position.col(static_cast<Eigen::Index>(i)) + u.col(contact.node[i]))
                    .value < 1e-3)
                ++count;
    return count;
}

struct State {
    Matrix3Xd displacement, increment;
};

/// Seconds a step: the download that waits for the device is timed again alone and taken off.
double timed_steps(tled::Engine& engine, const tled::NodalConditions& conditions, const State& start, int steps,
                   const tled::StepCoefficients& step) {
    engine.set_conditions(conditions);
    engine.set_state(start.displacement, start.increment);
    engine.run(2, step);  // compiles what is new
    engine.displacement();
    const double begin = now();
    engine.run(steps, step);
    engine.displacement();
    const double middle = now();
    engine.displacement();
    return ((middle - begin) - (now() - middle)) / steps;
}

/// A device at rest takes most of a second to reach its clock under load.
constexpr double warm_up_seconds = 1;

int steps_for(double seconds, tled::Engine& engine, const Scene& scene, const tled::StepCoefficients& step) {
    const State start{scene.start, Matrix3Xd::Zero(3, scene.start.cols())};
    double per_step = 1;
    int steps = 10;
    for (const double begin = now(); now() - begin < warm_up_seconds;) {
        per_step = timed_steps(engine, scene.conditions, start, steps, step);
        steps = std::clamp(static_cast<int>(seconds / std::max(per_step, 1e-7)), 10, 5000);
    }
    return steps;
}

void report(tled::Engine& engine, const std::string& name, const Scene& scene, const tled::RestState& rest,
            const Options& options) {
    const tled::StepCoefficients step = coefficients(rest);
    const int steps = steps_for(options.seconds, engine, scene, step);
    const Matrix3Xd still = Matrix3Xd::Zero(3, scene.start.cols());
    for (const Case& each : cases(scene.mesh)) {
        if (each.name.find(options.only) == std::string::npos) continue;
        tled::NodalConditions with = scene.conditions;
        with.effects = tled::nodal_effects(each.effects, rest);
        engine.set_conditions(with);
        engine.set_state(scene.start, still);
        engine.run(options.approach, step);
        const State start{engine.displacement(), engine.increment()};
        std::vector<double> plain, ratio;
        for (int round = 0; round < options.rounds; ++round) {
            plain.push_back(timed_steps(engine, scene.conditions, start, steps, step));
            ratio.push_back(timed_steps(engine, with, start, steps, step) / plain.back());
        }
        std::printf("| %-38s | %-24s | %9d | %9.2f | %6.3f | %5d | %6.3f |\n", each.name.c_str(), name.c_str(),
                    rest.element_count(), median(plain) * 1e6, median(ratio), touching(with, start.displacement),
                    tled::jacobians(rest, engine.displacement()).minCoeff());
        std::fflush(stdout);
    }
}

std::unique_ptr<tled::Engine> make_engine(const std::string& name, const tled::RestState& rest, int device) {
    if (name == "cpu") return tled::make_cpu_engine(rest);
    if (name == "two-passes") return tled::make_gpu_engine(rest, device, tled::GpuStepShape{});
    if (name == "gpu") return tled::make_gpu_engine(rest, device);
    throw InvalidInput("no engine " + name + "; take cpu, gpu or two-passes");
}

void measure(meshing::TetMesh mesh, const Options& options) {
    const Scene scene = stretched(std::move(mesh), -0.1);
    for (const Variant& variant : variants(scene, options.element, options.law))
        for (const std::string& name : options.engines)
            report(*make_engine(name, variant.rest, options.device), variant.name + ", " + name, scene, variant.rest,
                   options);
}

std::vector<std::string> split(const std::string& list) {
    std::istringstream stream(list);
    std::vector<std::string> parts;
    for (std::string part; std::getline(stream, part, ',');) parts.push_back(part);
    return parts;
}

Options parsed(int argc, char** argv) {
    Options options;
    for (int i = 1; i + 1 < argc; i += 2) {
        const std::string name = argv[i], value = argv[i + 1];
        if (name == "--device")
            options.device = std::stoi(value);
        else if (name == "--cells") {
            options.cells.clear();
            for (const std::string& cells : split(value)) options.cells.push_back(std::stoi(cells));
        } else if (name == "--engines")
            options.engines = split(value);
        else if (name == "--element")
            options.element = value;
        else if (name == "--law")
            options.law = value;
        else if (name == "--mesh")
            options.mesh = value;
        else if (name == "--only")
            options.only = value;
        else if (name == "--rounds")
            options.rounds = std::max(1, std::stoi(value));
        else if (name == "--approach")
            options.approach = std::stoi(value);
        else if (name == "--seconds")
            options.seconds = std::stod(value);
        else
            throw InvalidInput("unknown option " + name + "; the head of effect_step_bench.cpp lists them");
    }
    if (argc % 2 == 0) throw InvalidInput(std::string(argv[argc - 1]) + " needs a value");
    return options;
}

}  // namespace

int main(int argc, char** argv) try {
    const Options options = parsed(argc, argv);
    std::printf("median ratio of %d rounds of %.1f s\n\n", options.rounds, options.seconds);
    std::printf(
        "| effects | element, law, engine | elements | plain µs/step | with effects / plain | touching nodes | min J "
        "|\n|---|---|---|---|---|---|---|\n");
    if (options.mesh.empty())
        for (const int cells : options.cells)
            measure(meshing::box_mesh({edge, edge, edge}, {cells, cells, cells}), options);
    else
        measure(meshing::read_vtu(options.mesh), options);
    return 0;
} catch (const std::exception& error) {
    std::fprintf(stderr, "effect_step_bench: %s\n", error.what());
    return 1;
}
