#include "registration/loads/tissue_sides.hpp"

#include <algorithm>

namespace tissuewarp::registration::detail {

std::vector<int> sides_of(const PreparedModel& prepared) {
    const meshing::TetMesh& mesh = prepared.model.mesh;
    constexpr int slides = -1;
    std::vector<int> sides(static_cast<std::size_t>(mesh.nodes.cols()), 0);
    for (const tled::SlidingPair& pair : prepared.sliding)
        for (const int node : {pair.first, pair.second}) sides[static_cast<std::size_t>(node)] = slides;
    for (Eigen::Index t = 0; t < mesh.tets.cols(); ++t)
        for (const int node : mesh.tets.col(t))
            if (sides[static_cast<std::size_t>(node)] == slides) sides[static_cast<std::size_t>(node)] = mesh.labels[t];
    return sides;
}

std::vector<int> sliding_labels(const PreparedModel& prepared) {
    std::vector<int> labels;
    for (const std::array<int, 2>& pair : prepared.options.sliding)
        labels.insert(labels.end(), pair.begin(), pair.end());
    std::sort(labels.begin(), labels.end());
    labels.erase(std::unique(labels.begin(), labels.end()), labels.end());
    return labels;
}

Side side_of(const meshing::TetMesh& whole, int label) {
    std::vector<int> place(static_cast<std::size_t>(whole.nodes.cols()), -1), tets;
    Side side;
    for (int t = 0; t < whole.tet_count(); ++t) {
        if (whole.labels[t] != label) continue;
        tets.push_back(t);
        for (const int node : whole.tets.col(t)) {
            if (place[static_cast<std::size_t>(node)] >= 0) continue;
            place[static_cast<std::size_t>(node)] = static_cast<int>(side.nodes.size());
            side.nodes.push_back(node);
        }
    }
    side.mesh.nodes = whole.nodes(Eigen::all, side.nodes);
    side.mesh.tets =
        whole.tets(Eigen::all, tets).unaryExpr([&](int node) { return place[static_cast<std::size_t>(node)]; });
    side.mesh.labels = whole.labels(tets);
    return side;
}

}  // namespace tissuewarp::registration::detail
