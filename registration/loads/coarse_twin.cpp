#include "registration/loads/coarse_twin.hpp"

#include "meshing/search/point_tree.hpp"
#include "registration/springs/pull.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace tissuewarp::registration::detail {

namespace {

constexpr int most_nodes_for_loads = coarse_twin_options.most_nodes_for_loads;

PrepareOptions coarse_options(PrepareOptions options, double edge_length) {
    options.meshing.edge_length = edge_length;
    options.meshing.label_edge_length.clear();
    options.anchors.clear();  // among the springs
    options.rigid_neighbours.clear();
    options.resected.clear();  // not in the model's labels
    return options;
}

/// Near, or as far outside as coarse meshes cut corners off.
std::optional<meshing::Location> place_of(const meshing::PointLocator& locator, const Eigen::Vector3d& point) {
    for (const double tolerance : coarse_twin_options.outside) {
        auto found =
            tolerance > place_options.outside.back() ? locator.find(point, tolerance) : locate_near(locator, point);
        if (!found) continue;
        found->barycentric = found->barycentric.cwiseMax(0.0);
        found->barycentric /= found->barycentric.sum();
        return found;
    }
    return std::nullopt;
}

std::vector<tled::Spring> moved(const std::vector<tled::Spring>& springs, const Eigen::Matrix3Xd& from,
                                const meshing::TetMesh& to, const meshing::PointLocator& locator) {
    std::vector<Pull> pulls;
    for (const tled::Spring& spring : springs)
        if (const auto at = place_of(locator, from.col(spring.node)))
            pulls.push_back({*at, spring.target, spring.stiffness});
    return lumped_springs(to, pulls, Eigen::Matrix3Xd::Zero(3, to.nodes.cols()));
}

double total(const std::vector<tled::Spring>& springs) {
    double sum = 0;
    for (const tled::Spring& spring : springs) sum += spring.stiffness.trace();
    return sum;
}

/// On every interface node that of the nearest, all together as stiff as they were. Summed up, springs along normals
/// that differ would hold a coarse mesh along its surface too.
std::vector<tled::Spring> sampled(const std::vector<tled::Spring>& springs, const Eigen::Matrix3Xd& from,
                                  const PreparedModel& to) {
    if (springs.empty()) return {};
    std::vector<Eigen::Vector3d> places;
    places.reserve(springs.size());
    for (const tled::Spring& spring : springs) places.emplace_back(from.col(spring.node));
    const meshing::PointTree tree(places);
    std::vector<tled::Spring> result;
    for (const InterfaceNode& node : to.interfaces.nodes()) {
        const int nearest = tree.nearest(to.model.mesh.nodes.col(node.node)).index;
        const tled::Spring& spring = springs[static_cast<std::size_t>(nearest)];
        result.push_back({node.node, spring.stiffness, spring.target});
    }
    const double share = total(springs) / total(result);
    for (tled::Spring& spring : result) spring.stiffness *= share;
    return result;
}

void add(LastPulls& pulls, const PulledNode& like, const std::vector<tled::Spring>& springs) {
    for (const tled::Spring& spring : springs)
        pulls.springs.push_back({spring, like.origin, like.shared_mm, like.shows_mm});
}

/// Data of one kind after the other: what is known of them beside their springs is the same.
std::vector<std::vector<PulledNode>> by_kind(const std::vector<PulledNode>& data) {
    std::vector<std::vector<PulledNode>> kinds;
    for (const PulledNode& pulled : data) {
        const auto same = std::find_if(kinds.begin(), kinds.end(), [&](const auto& kind) {
            return kind.front().shared_mm == pulled.shared_mm && kind.front().shows_mm == pulled.shows_mm;
        });
        if (same == kinds.end())
            kinds.push_back({pulled});
        else
            same->push_back(pulled);
    }
    return kinds;
}

std::vector<tled::Spring> springs_of(const std::vector<PulledNode>& pulled) {
    std::vector<tled::Spring> result;
    for (const PulledNode& each : pulled) result.push_back(each.spring);
    return result;
}

}  // namespace

Eigen::MatrixXd carried(const meshing::TetMesh& from, const Eigen::MatrixXd& nodal, const Eigen::Matrix3Xd& to) {
    const meshing::PointLocator locator(from);
    const meshing::PointTree tree(from.nodes);
    Eigen::MatrixXd result(nodal.rows(), to.cols());
    for (Eigen::Index p = 0; p < to.cols(); ++p) {
        if (const auto at = place_of(locator, to.col(p))) {
            result.col(p) = meshing::interpolate(from, nodal, *at);
            continue;
        }
        result.col(p) = nodal.col(tree.nearest(to.col(p)).index);
    }
    return result;
}

PreparedModel coarse_model(const PreparedModel& prepared, double edge_length, Observer& observer) {
    return prepare(prepared.labels, coarse_options(prepared.options, edge_length), observer);
}

bool loads_take_coarse_model(const PreparedModel& prepared) {
    return prepared.rest.node_count > most_nodes_for_loads;
}

bool loads_will_take_coarse_model(const imaging::Volume& organ, const PrepareOptions& options) {
    constexpr double nodes_per_edge_cubed = 1.8;  // 10 463 nodes of the brain shift, whose organ has 5829 such cubes
    if (!options.anchors.empty() || !options.rigid_neighbours.empty()) return false;
    return nodes_per_edge_cubed * std::pow(organ_size(organ) / options.meshing.edge_length, 3) > most_nodes_for_loads;
}

PrepareOptions coarse_options_for_loads(const imaging::Volume& organ, const PrepareOptions& options) {
    return coarse_options(options, suggested_edge_length_without_labels(organ));
}

PreparedModel coarse_model_for_loads(const PreparedModel& prepared, Observer& observer) {
    return prepare(prepared.labels, coarse_options_for_loads(prepared.labels, prepared.options), observer);
}

PreparedModel coarse_model_for_loads(const PreparedModel& prepared, meshing::TetMesh mesh, Observer& observer) {
    return prepare(std::move(mesh), prepared.labels, coarse_options_for_loads(prepared.labels, prepared.options),
                   observer);
}

LastPulls pulls_on(const PreparedModel& coarse, const PreparedModel& prepared, const LastPulls& given) {
    const meshing::TetMesh& mesh = coarse.model.mesh;
    const Eigen::Matrix3Xd& nodes = prepared.model.mesh.nodes;
    const meshing::PointLocator locator(mesh);
    LastPulls pulls;
    const bool labels = !given.of(Origin::Hold).empty();
    for (const std::vector<PulledNode>& kind : by_kind(given.data())) {
        const std::vector<tled::Spring> springs = springs_of(kind);
        add(pulls, kind.front(), labels ? sampled(springs, nodes, coarse) : moved(springs, nodes, mesh, locator));
    }
    for (const Origin origin : {Origin::Prior, Origin::Support})
        add(pulls, {{}, origin}, moved(given.of(origin), nodes, mesh, locator));
    pulls.energy = given.energy;
    pulls.prior_moves = given.prior_moves;
    pulls.parts_alone = given.parts_alone;
    pulls.placement_sought = given.placement_sought;
    pulls.hardly_shown = given.hardly_shown;
    return pulls;
}

}  // namespace tissuewarp::registration::detail
