#include "registration/terms/anchors.hpp"

#include "registration/doubts.hpp"

#include <algorithm>
#include <set>

namespace tissuewarp::registration::detail {

std::vector<int> anchored_nodes(const PreparedModel& prepared) {
    const meshing::TetMesh& mesh = prepared.model.mesh;
    const std::vector<int>& anchors = prepared.options.anchors;
    const auto is_anchor = [&](int label) { return std::find(anchors.begin(), anchors.end(), label) != anchors.end(); };
    std::set<int> nodes;
    for (int tet = 0; tet < mesh.tet_count(); ++tet)
        if (is_anchor(mesh.labels[tet]))
            for (const int node : mesh.tets.col(tet)) nodes.insert(node);
    return {nodes.begin(), nodes.end()};
}

bool is_held(const PreparedModel& prepared) {
    return prepared.neighbours || !anchored_nodes(prepared).empty();
}

AnchorTerm::AnchorTerm(const PreparedModel& prepared, double energy) {
    constexpr double deviation = anchor_options.deviation_mm;
    const Eigen::Matrix3d stiffness = energy / (deviation * deviation) * Eigen::Matrix3d::Identity();
    for (const int node : anchored_nodes(prepared))
        springs_.push_back({{node, stiffness, Eigen::Vector3d::Zero()}, Origin::Support});
}

Contribution AnchorTerm::linearise(const RoundPlan& /*plan*/, const State& /*state*/, Observer& /*observer*/) {
    return {springs_};
}

void AnchorTerm::judge(const State& state, UpdateResult& result) {
    constexpr double most_mm = anchor_options.most_pull_mm;
    AnchorFit fit;
    for (const PulledNode& pulled : springs_) {
        ++fit.nodes;
        fit.largest_mm = std::max(fit.largest_mm, state.displacement.col(pulled.spring.node).norm());
    }
    result.anchors = fit;
    if (fit.largest_mm > most_mm)
        result.doubts.push_back({"anchors.pulled", fit.largest_mm, most_mm,
                                 "anchored tissue was pulled by up to " + to_text(fit.largest_mm) + " mm",
                                 "check which tissue stays, and the rigid placement"});
}

}  // namespace tissuewarp::registration::detail
