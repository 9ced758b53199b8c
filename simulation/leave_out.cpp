#include "simulation/leave_out.hpp"

#include "simulation/build.hpp"
#include "simulation/loads.hpp"
#include "tled/nodal_effects.hpp"
#include "tled/region.hpp"
#include "tled/stiffness/rest_stiffness.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <numeric>
#include <set>

namespace tissuewarp::simulation {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

namespace {

constexpr std::array shares{0.125, 0.25, 0.375, 0.5, 0.625, 0.75};  // of the tetrahedra, kept besides those needed
constexpr double linear_safety = 5;  // beside a tool with friction a probe moved by 4.2 times the estimate
constexpr int least_samples = 32;    // of forces that change with time, in dynamics

/// Forces at frames, or at more times where what happens between them counts.
std::vector<double> sampled_times(const Solve& solve) {
    const bool dynamics = solve.kind == Solve::Kind::Dynamics;
    const int count = dynamics ? std::max(solve.frames, least_samples) : solve.frames;
    std::vector<double> times;
    for (int n = 0; n <= count; ++n) times.push_back(solve.duration * n / count);
    return times;
}

/// Springs that push nodes which lie at rest in a body in contact out along its normal: what the linear answers know of
/// contact. `stiffness` is the diagonal at rest, mN/mm, 3 × N.
std::vector<tled::Spring> pushing_out(const tled::Conditions& conditions, const Matrix3Xd& position,
                                      const Matrix3Xd& stiffness) {
    constexpr double stiffer = 100;  // than the tissue
    std::vector<tled::Spring> springs;
    if (!conditions.effects.contact) return springs;
    for (const int node : conditions.effects.contact->nodes)
        for (const tled::Obstacle& obstacle : conditions.effects.contact->obstacles) {
            const tled::Distance distance = tled::distance_to(obstacle, position.col(node));
            if (!(distance.value < 0)) continue;
            const Vector3d n = distance.gradient.normalized();
            springs.push_back({node, stiffer * stiffness.col(node).mean() * n * n.transpose(), -distance.value * n});
        }
    return springs;
}

/// Nodes whose tetrahedra are needed whatever lies near.
std::set<int> needed_nodes(const BuiltScene& built, const std::vector<double>& times, const Matrix3Xd& stiffness) {
    std::set<int> nodes;
    for (const double time : times)
        for (const tled::Spring& each :
             pushing_out(conditions_at(built, built.stages.front(), time), built.mesh.nodes, stiffness))
            nodes.insert(each.node);
    const tled::Effects effects = conditions_at(built, built.stages.front(), times.back()).effects;
    const auto add = [&](const Eigen::Matrix3Xi& faces) {
        nodes.insert(faces.reshaped().begin(), faces.reshaped().end());
    };
    for (const tled::SurfacePressure& each : effects.pressures) add(each.faces);
    for (const tled::Membrane& each : effects.membranes) add(each.faces);
    for (const std::vector<tled::SlidingPair>* pairs : {&effects.sliding, &effects.parting})
        for (const tled::SlidingPair& pair : *pairs) nodes.insert({pair.first, pair.second});
    for (const meshing::Location& probe : built.probes)
        for (const int node : built.mesh.tets.col(probe.tet)) nodes.insert(node);
    return nodes;
}

/// Tetrahedra, those nearest to a probe first.
std::vector<int> by_distance(const BuiltScene& built) {
    const meshing::TetMesh& mesh = built.mesh;
    std::vector<double> distance(static_cast<std::size_t>(mesh.tet_count()), std::numeric_limits<double>::infinity());
    for (int e = 0; e < mesh.tet_count(); ++e) {
        const Vector3d centroid = mesh.nodes(Eigen::all, mesh.tets.col(e)).rowwise().mean();
        for (const Probe& probe : built.scene.probes)
            distance[static_cast<std::size_t>(e)] =
                std::min(distance[static_cast<std::size_t>(e)], (probe.at - centroid).norm());
    }
    std::vector<int> order(distance.size());
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
        return distance[static_cast<std::size_t>(a)] < distance[static_cast<std::size_t>(b)];
    });
    return order;
}

Matrix3Xd diagonal_stiffness(const tled::RestState& rest, const tled::Conditions& conditions) {
    const tled::NodalConditions nodal = tled::nodal_conditions(conditions, rest);
    return tled::RestStiffness(rest, nodal).diagonal(nodal);
}

std::vector<bool> needed_tets(const BuiltScene& built, const std::set<int>& nodes) {
    std::vector<bool> needed(static_cast<std::size_t>(built.mesh.tet_count()), false);
    for (int e = 0; e < built.mesh.tet_count(); ++e)
        for (const int node : built.mesh.tets.col(e))
            if (nodes.contains(node)) needed[static_cast<std::size_t>(e)] = true;
    return needed;
}

std::vector<int> nodes_of_probes(const BuiltScene& built) {
    std::vector<int> nodes;
    for (const meshing::Location& probe : built.probes)
        for (const int node : built.mesh.tets.col(probe.tet)) nodes.push_back(node);
    return nodes;
}

/// All but what is needed and this share of the tetrahedra, in their order.
LeftOut all_but(const std::vector<bool>& needed, const std::vector<int>& order, double share) {
    LeftOut left;
    left.keep = needed;
    const auto nearest = static_cast<std::size_t>(share * static_cast<double>(order.size()));
    for (std::size_t n = 0; n < nearest; ++n) left.keep[static_cast<std::size_t>(order[n])] = true;
    left.tetrahedra = static_cast<int>(std::count(left.keep.begin(), left.keep.end(), false));
    return left;
}

}  // namespace

std::optional<LeftOut> left_out(const BuiltScene& built, Observer& observer) {
    const tled::Model& whole = built.stages.front().model;
    const std::vector<double> times = sampled_times(built.scene.solve);
    const tled::Conditions conditions = conditions_at(built, built.stages.front(), times.back());
    const Matrix3Xd stiffness = diagonal_stiffness(built.stages.front().rest, conditions);
    tled::Conditions told = conditions;
    for (const tled::Spring& each : pushing_out(conditions, built.mesh.nodes, stiffness)) told.springs.push_back(each);
    const std::vector<bool> needed = needed_tets(built, needed_nodes(built, times, stiffness));
    const std::vector<int> order = by_distance(built), targets = nodes_of_probes(built);
    const Matrix3Xd answer = tled::linear_answer(whole, told);

    std::optional<LeftOut> most;
    std::unique_ptr<const tled::FarTissue> far;   // of that
    std::size_t first = 0, last = shares.size();  // those that may be enough
    while (first < last) {
        const std::size_t middle = (first + last) / 2;
        observer.checkpoint("looking for tissue to leave out", double(middle) / shares.size());
        LeftOut candidate = all_but(needed, order, shares[middle]);
        if (4 * candidate.tetrahedra < built.mesh.tet_count()) {
            last = middle;
            continue;
        }
        auto rest = std::make_unique<const tled::FarTissue>(whole, told, candidate.keep);
        candidate.estimated_change_mm = tled::region_of(whole, told, *rest, targets, answer).estimated_change_mm;
        if (candidate.estimated_change_mm == 0) return std::nullopt;  // no load that a linear answer knows
        if (linear_safety * candidate.estimated_change_mm > built.scene.leave_out->tolerance_mm) {
            first = middle + 1;
            continue;
        }
        last = middle;
        most = std::move(candidate);
        far = std::move(rest);
    }
    if (!most) return most;
    most->nodes = far->nodes();
    most->springs = far->springs(conditions);
    most->times = times;
    for (const double time : times) most->force.push_back(far->force(conditions_at(built, built.stages.front(), time)));
    return most;
}

std::string text_of(const LeftOut& left_out) {
    char text[160];
    std::snprintf(text, sizeof text,
                  "%d of %zu tetrahedra are left out; by linear answers that moves no probe by more than %.2g mm",
                  left_out.tetrahedra, left_out.keep.size(), left_out.estimated_change_mm);
    return text;
}

Matrix3Xd far_force(const LeftOut& left_out, double time) {
    const std::vector<double>& times = left_out.times;
    const auto after = std::upper_bound(times.begin(), times.end(), time);
    const auto next = static_cast<std::size_t>(std::min(after, times.end() - 1) - times.begin());
    if (next == 0) return left_out.force.front();
    const double part = std::clamp((time - times[next - 1]) / (times[next] - times[next - 1]), 0.0, 1.0);
    return (1 - part) * left_out.force[next - 1] + part * left_out.force[next];
}

}  // namespace tissuewarp::simulation
