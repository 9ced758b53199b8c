#include "registration/boundary/surroundings.hpp"

#include "core/errors.hpp"
#include "imaging/filters.hpp"
#include "imaging/labels.hpp"

#include <algorithm>

namespace tissuewarp::registration {

namespace {

bool is_one_of(int label, const std::vector<int>& labels) {
    return std::find(labels.begin(), labels.end(), label) != labels.end();
}

/// The distance to midpoints between voxels is rough where the boundary is oblique to the grid: normals would be, too.
imaging::Volume smooth_distance(const imaging::Volume& neighbours) {
    imaging::Volume distance = imaging::signed_distance(imaging::mask_of_all(neighbours));
    distance.geometry.spacing.setOnes();
    distance = imaging::smooth(distance, detail::NeighbourOptions().smoothing_voxels);
    distance.geometry = neighbours.geometry;
    return distance;
}

}  // namespace

void require_surroundings(const imaging::Volume& moving_labels, const PrepareOptions& options) {
    const std::vector<int>&anchors = options.anchors, &neighbours = options.rigid_neighbours;
    if (anchors.empty() && neighbours.empty()) return;
    for (const std::vector<int>* list : {&anchors, &neighbours})
        imaging::require_labels(moving_labels, *list, list == &anchors ? "anchors" : "rigid neighbours");
    for (const int label : anchors)
        if (is_one_of(label, neighbours))
            throw InvalidInput("label " + std::to_string(label) +
                               " is given both as anchor and as rigid neighbour; an anchor is tissue that the model "
                               "holds, a neighbour is not in the model: choose one");
    const std::vector<int> present = imaging::labels_in(moving_labels);
    const auto is_tissue = [&](int label) { return !is_one_of(label, anchors) && !is_one_of(label, neighbours); };
    if (std::none_of(present.begin(), present.end(), is_tissue))
        throw InvalidInput(
            "every label is an anchor or a rigid neighbour: nothing is left to register; name fewer of them");
}

namespace detail {

std::optional<RigidNeighbours> rigid_neighbours(const imaging::Volume& map, const std::vector<int>& labels) {
    if (labels.empty()) return std::nullopt;
    std::vector<int> others;
    for (const int label : imaging::labels_in(map))
        if (!is_one_of(label, labels)) others.push_back(label);
    RigidNeighbours result{imaging::without_labels(map, others), {}};
    result.distance = smooth_distance(result.labels);
    return result;
}

imaging::Volume with_neighbours(const PreparedModel& prepared) {
    if (!prepared.neighbours) return prepared.labels;
    imaging::Volume map = prepared.labels.as(CV_32S).clone();
    map.voxels += prepared.neighbours->labels.as(CV_32S).voxels;
    return map;
}

Intraoperative without_neighbours(const Intraoperative& seen, const std::vector<int>& labels) {
    Intraoperative result = seen;
    if (result.labels) result.labels = imaging::without_labels(*result.labels, labels);
    return result;
}

}  // namespace detail

}  // namespace tissuewarp::registration
