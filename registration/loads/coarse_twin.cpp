#include "registration/loads/coarse_twin.hpp"

#include "meshing/search/point_tree.hpp"
#include "registration/loads/tissue_sides.hpp"
#include "registration/springs/pull.hpp"

#include <algorithm>
#include <cmath>
#include <map>
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

/// Those at nodes of one side.
std::vector<tled::Spring> at_side(const std::vector<tled::Spring>& springs, const std::vector<int>& sides, int label) {
    std::vector<tled::Spring> result = springs;
    std::erase_if(result, [&](const tled::Spring& spring) { return sides[std::size_t(spring.node)] != label; });
    return result;
}

/// Each side's to that side's tissue.
std::vector<tled::Spring> moved(const std::vector<tled::Spring>& springs, const PreparedModel& from,
                                const PreparedModel& to, const meshing::PointLocator& locator) {
    const std::vector<int> sides = sides_of(from);
    const Eigen::Matrix3Xd& nodes = from.model.mesh.nodes;
    std::vector<tled::Spring> result = moved(at_side(springs, sides, 0), nodes, to.model.mesh, locator);
    for (const int label : sliding_labels(from)) {
        const Side side = side_of(to.model.mesh, label);
        for (tled::Spring spring :
             moved(at_side(springs, sides, label), nodes, side.mesh, meshing::PointLocator(side.mesh))) {
            spring.node = side.nodes[std::size_t(spring.node)];
            result.push_back(spring);
        }
    }
    return result;
}

double total(const std::vector<tled::Spring>& springs) {
    double sum = 0;
    for (const tled::Spring& spring : springs) sum += spring.stiffness.trace();
    return sum;
}

/// The nearest of some springs.
class NearestSpring {
public:
    NearestSpring(std::vector<tled::Spring> springs, const Eigen::Matrix3Xd& nodes)
        : springs_(std::move(springs)), tree_(places(springs_, nodes)) {}

    [[nodiscard]] const tled::Spring& to(const Eigen::Vector3d& place) const {
        return springs_[static_cast<std::size_t>(tree_.nearest(place).index)];
    }

private:
    std::vector<tled::Spring> springs_;
    meshing::PointTree tree_;

    static std::vector<Eigen::Vector3d> places(const std::vector<tled::Spring>& springs,
                                               const Eigen::Matrix3Xd& nodes) {
        std::vector<Eigen::Vector3d> result;
        result.reserve(springs.size());
        for (const tled::Spring& spring : springs) result.emplace_back(nodes.col(spring.node));
        return result;
    }
};

/// On every interface node that of the nearest, of the same side where tissue slides, all together as stiff as they
/// were. Summed up, springs along normals that differ would hold a coarse mesh along its surface too.
std::vector<tled::Spring> sampled(const std::vector<tled::Spring>& springs, const PreparedModel& from,
                                  const PreparedModel& to) {
    if (springs.empty()) return {};
    const std::vector<int> sides_from = sides_of(from), sides_to = sides_of(to);
    std::map<int, NearestSpring> nearest;
    nearest.try_emplace(0, springs, from.model.mesh.nodes);
    for (const int label : sliding_labels(from))
        if (const auto of_side = at_side(springs, sides_from, label); !of_side.empty())
            nearest.try_emplace(label, of_side, from.model.mesh.nodes);
    std::vector<tled::Spring> result;
    for (const InterfaceNode& node : to.interfaces.nodes()) {
        const auto side = nearest.find(sides_to[std::size_t(node.node)]);
        const tled::Spring& spring =
            (side == nearest.end() ? nearest.at(0) : side->second).to(to.model.mesh.nodes.col(node.node));
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

Eigen::MatrixXd carried(const PreparedModel& from, const Eigen::MatrixXd& nodal, const PreparedModel& to) {
    const Eigen::Matrix3Xd& places = to.model.mesh.nodes;
    Eigen::MatrixXd result = carried(from.model.mesh, nodal, places);
    const std::vector<int> sides = sides_of(to);
    for (const int label : sliding_labels(to)) {
        const Side side = side_of(from.model.mesh, label);
        std::vector<int> there;
        for (std::size_t n = 0; n < sides.size(); ++n)
            if (sides[n] == label) there.push_back(static_cast<int>(n));
        result(Eigen::all, there) = carried(side.mesh, nodal(Eigen::all, side.nodes), places(Eigen::all, there));
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
    const meshing::PointLocator locator(mesh);
    LastPulls pulls;
    const bool labels = !given.of(Origin::Hold).empty();
    for (const std::vector<PulledNode>& kind : by_kind(given.data())) {
        const std::vector<tled::Spring> springs = springs_of(kind);
        add(pulls, kind.front(),
            labels ? sampled(springs, prepared, coarse) : moved(springs, prepared, coarse, locator));
    }
    for (const Origin origin : {Origin::Prior, Origin::Support})
        add(pulls, {{}, origin}, moved(given.of(origin), prepared, coarse, locator));
    pulls.energy = given.energy;
    pulls.prior_moves = given.prior_moves;
    pulls.parts_alone = given.parts_alone;
    pulls.placement_sought = given.placement_sought;
    pulls.hardly_shown = given.hardly_shown;
    return pulls;
}

}  // namespace tissuewarp::registration::detail
