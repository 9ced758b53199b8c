#include "tests/verification/solution.hpp"

#include "core/errors.hpp"
#include "tled/reference/discrete_energy.hpp"
#include "tled/reference/newton.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <limits>
#include <set>

namespace tissuewarp::verification {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

namespace {

constexpr double tolerance_mm = 1e-6;

/// The discrete energy with what it refers to.
struct Discretisation {
    tled::RestState rest;
    std::unique_ptr<tled::DiscreteEnergy> energy;
};

std::unique_ptr<Discretisation> discretise(const Problem& problem, Elements elements, Solution& solution) {
    auto result = std::make_unique<Discretisation>();
    if (!is_quadratic(elements)) {
        const tled::Model model = linear_model(problem, elements, solution.mesh);
        result->rest = tled::rest_state(model);
        result->energy = std::make_unique<tled::LinearTetrahedra>(result->rest);
        return result;
    }
    solution.curved = tled::quadratic_mesh(solution.mesh, problem.middle);
    const tled::QuadraticOptions options{
        .quadrature = problem.middle ? tled::Quadrature::Points11 : tled::Quadrature::Points4,
        .pressure = elements == Elements::Quadratic ? tled::QuadraticPressure::Pointwise
                                                    : tled::QuadraticPressure::NodalAverage};
    result->energy = std::make_unique<tled::QuadraticTetrahedra>(*solution.curved, problem.materials, options);
    return result;
}

void add_linear_traction(const meshing::TetMesh& mesh, const std::array<int, 3>& face, const Vector3d& traction,
                         Matrix3Xd& load) {
    const Vector3d a = mesh.nodes.col(face[0]), b = mesh.nodes.col(face[1]), c = mesh.nodes.col(face[2]);
    const double area = 0.5 * (b - a).cross(c - a).norm();
    for (const int node : face) load.col(node) += area / 3.0 * traction;
}

// Equal parts of what acts on each element to its corners.
Matrix3Xd linear_body_load(const meshing::TetMesh& mesh, const Vector3d& body_force) {
    Matrix3Xd load = Matrix3Xd::Zero(3, mesh.node_count());
    const Eigen::VectorXd volume = meshing::tet_volumes(mesh);
    for (int e = 0; e < mesh.tet_count(); ++e) {
        for (const int node : mesh.tets.col(e)) load.col(node) += volume[e] / 4.0 * body_force;
    }
    return load;
}

Matrix3Xd load_of(const Problem& problem, const Solution& solution) {
    Matrix3Xd load = Matrix3Xd::Zero(3, solution.nodes().cols());
    if (!problem.body_force.isZero() && solution.curved) load = tled::body_load(*solution.curved, problem.body_force);
    if (!problem.body_force.isZero() && !solution.curved) load = linear_body_load(solution.mesh, problem.body_force);
    if (problem.tractions.empty()) return load;
    for (const meshing::InterfaceFace& face : meshing::interface_faces(solution.mesh)) {
        for (const Traction& traction : problem.tractions) {
            const auto on = [&](int node) { return traction.on(solution.mesh.nodes.col(node)); };
            if (face.outer != 0 || !on(face.nodes[0]) || !on(face.nodes[1]) || !on(face.nodes[2])) continue;
            if (solution.curved) {
                tled::add_traction(*solution.curved, face.nodes, traction.value, load);
            } else {
                add_linear_traction(solution.mesh, face.nodes, traction.value, load);
            }
        }
    }
    return load;
}

tled::Conditions conditions_of(const Problem& problem, const Solution& solution, int stage,
                               const std::set<int>& touching) {
    tled::Conditions conditions;
    conditions.external_force = load_of(problem, solution);
    for (int i = 0; i < solution.nodes().cols(); ++i) {
        tled::PrescribedDisplacement held = problem.hold(solution.nodes().col(i), stage);
        held.node = i;
        if (touching.contains(i) && !held.constrained[2]) {
            held.constrained[2] = true;
            held.displacement[2] = problem.plane_height(stage) - solution.nodes()(2, i);
        }
        if (held.constrained[0] || held.constrained[1] || held.constrained[2]) conditions.prescribed.push_back(held);
    }
    return conditions;
}

// Releases nodes that the plane would have to pull, adds nodes that went through it. False when nothing changed.
bool update_contact(const Problem& problem, const Solution& solution, int stage, std::set<int>& touching) {
    const double height = problem.plane_height(stage);
    constexpr double through_mm = 1e-7;
    std::set<int> next;
    for (int i = 0; i < solution.nodes().cols(); ++i) {
        const Vector3d X = solution.nodes().col(i);
        if (!problem.may_touch(X) || problem.hold(X, stage).constrained[2]) continue;
        const bool pushed = touching.contains(i) && solution.force(2, i) <= 0.0;
        const bool through = solution.nodes()(2, i) + solution.displacement(2, i) > height + through_mm;
        if (pushed || (!touching.contains(i) && through)) next.insert(i);
    }
    if (next == touching) return false;
    touching = std::move(next);
    return true;
}

}  // namespace

const char* name_of(Elements elements) {
    switch (elements) {
        case Elements::T4:
            return "T4";
        case Elements::AveragedPressure:
            return "averaged pressure";
        case Elements::Quadratic:
            return "T10";
        case Elements::QuadraticMixed:
            return "T10 mixed";
    }
    return "";
}

tled::Model linear_model(const Problem& problem, Elements elements, const meshing::TetMesh& mesh) {
    tled::Model model;
    model.mesh = mesh;
    model.materials = problem.materials;
    model.element = elements == Elements::T4 ? tled::Element::T4 : tled::Element::AveragedPressureT4;
    return model;
}

tled::NodalConditions nodal_conditions_of(const Problem& problem, const meshing::TetMesh& mesh) {
    Solution part;
    part.mesh = mesh;
    return tled::nodal_conditions(conditions_of(problem, part, problem.stages, {}), mesh.node_count());
}

Solution solve(const Problem& problem, Elements elements, int level) {
    constexpr int most_contact_rounds = 40, most_iterations = 300;  // near ν = ½ under full load, some 100
    Solution solution;
    solution.mesh = problem.mesh(level);
    const auto discretisation = discretise(problem, elements, solution);
    const tled::DiscreteEnergy& energy = *discretisation->energy;
    solution.displacement = solution.force = Matrix3Xd::Zero(3, energy.node_count());
    std::set<int> touching;
    if (problem.plane_height) update_contact(problem, solution, 1, touching);
    for (int stage = 1; stage <= problem.stages; ++stage) {
        for (int round = 0;; ++round) {
            tled::NewtonOptions options{.tolerance_mm = tolerance_mm, .max_iterations = most_iterations};
            if (stage > 1 || round > 0) options.start = solution.displacement;
            const tled::NewtonResult found = tled::newton_equilibrium(
                energy, tled::nodal_conditions(conditions_of(problem, solution, stage, touching), energy.node_count()),
                options);
            solution.displacement = found.displacement;
            solution.iterations += found.iterations;
            solution.force = energy.force(found.displacement);
            if (!problem.plane_height || !update_contact(problem, solution, stage, touching)) break;
            if (round == most_contact_rounds) throw SolverFailure("the contact set does not settle: " + problem.name);
        }
    }
    solution.energy = energy.energy(solution.displacement);
    solution.min_jacobian = tled::smallest_element_jacobian(energy, solution.displacement).value;
    return solution;
}

Vector3d Solution::at(const Vector3d& X) const {
    int best = 0;
    double best_smallest = -std::numeric_limits<double>::infinity();
    Vector3d local = Vector3d::Zero();
    for (int t = 0; t < mesh.tet_count(); ++t) {
        const Eigen::Vector4i corner = mesh.tets.col(t);
        Eigen::Matrix3d edges;
        for (int k = 0; k < 3; ++k) edges.col(k) = mesh.nodes.col(corner[k + 1]) - mesh.nodes.col(corner[0]);
        const Vector3d candidate = edges.inverse() * (X - mesh.nodes.col(corner[0]));
        const double smallest = std::min(candidate.minCoeff(), 1.0 - candidate.sum());
        if (smallest <= best_smallest) continue;
        best = t;
        best_smallest = smallest;
        local = candidate;
    }
    if (!curved) {
        const Eigen::Vector4d weight(1.0 - local.sum(), local[0], local[1], local[2]);
        Vector3d result = Vector3d::Zero();
        for (int c = 0; c < 4; ++c) result += weight[c] * displacement.col(mesh.tets(c, best));
        return result;
    }
    Eigen::Matrix<double, 3, 10> nodes_here, u;
    for (int c = 0; c < 10; ++c) {
        nodes_here.col(c) = curved->nodes.col(curved->tets(c, best));
        u.col(c) = displacement.col(curved->tets(c, best));
    }
    for (int iteration = 0; iteration < 8;
         ++iteration) {  // Newton's method for X(ξ) = X; one step where edges are straight
        const Vector3d miss = X - nodes_here * tled::quadratic_shape(local);
        local += (nodes_here * tled::quadratic_shape_derivatives(local)).inverse() * miss;
    }
    return u * tled::quadratic_shape(local);
}

std::vector<int> Solution::nodes_on(const std::function<bool(const Vector3d&)>& on) const {
    std::vector<int> result;
    for (int i = 0; i < nodes().cols(); ++i) {
        if (on(nodes().col(i))) result.push_back(i);
    }
    return result;
}

Vector3d Solution::reaction(const std::function<bool(const Vector3d&)>& on) const {
    Vector3d sum = Vector3d::Zero();
    for (const int i : nodes_on(on)) sum += force.col(i);
    return sum;
}

double Solution::deformed_volume() const {
    if (!curved) {
        meshing::TetMesh deformed = mesh;
        deformed.nodes += displacement;
        return meshing::tet_volumes(deformed).sum();
    }
    tled::QuadraticMesh deformed = *curved;
    deformed.nodes += displacement;
    return tled::body_load(deformed, Vector3d::UnitZ()).row(2).sum();
}

}  // namespace tissuewarp::verification
