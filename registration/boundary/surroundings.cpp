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

}  // namespace

void require_surroundings(const imaging::Volume& moving_labels, const PrepareOptions& options) {
    const std::vector<int>&anchors = options.anchors, &neighbours = options.rigid_neighbours,
          &resected = options.resected;
    if (anchors.empty() && neighbours.empty() && resected.empty() && options.sliding.empty()) return;
    imaging::require_labels(moving_labels, anchors, "anchors");
    imaging::require_labels(moving_labels, neighbours, "rigid neighbours");
    imaging::require_labels(moving_labels, resected, "resected tissue");
    const auto refuse_both = [](const std::vector<int>& some, const std::vector<int>& others, const char* words) {
        for (const int label : some)
            if (is_one_of(label, others)) throw InvalidInput("label " + std::to_string(label) + words);
    };
    refuse_both(anchors, neighbours,
                " is given both as anchor and as rigid neighbour; an anchor is tissue that the model "
                "holds, a neighbour is not in the model: choose one");
    refuse_both(resected, anchors, " is given both as anchor and as resected; what is gone holds nothing: choose one");
    refuse_both(resected, neighbours,
                " is given both as rigid neighbour and as resected; what is gone is in nobody's way: choose one");
    const std::vector<int> present = imaging::labels_in(moving_labels);
    const auto is_tissue = [&](int label) {
        return !is_one_of(label, anchors) && !is_one_of(label, neighbours) && !is_one_of(label, resected);
    };
    if (std::none_of(present.begin(), present.end(), is_tissue))
        throw InvalidInput(
            resected.empty()
                ? "every label is an anchor or a rigid neighbour: nothing is left to register; name fewer of them"
                : "every label is an anchor, a rigid neighbour or resected: nothing is left to register; name fewer of "
                  "them");
    for (const std::array<int, 2>& labels : options.sliding) {
        imaging::require_labels(moving_labels, {labels.begin(), labels.end()}, "tissue that slides");
        const auto is_meshed = [&](int label) { return !is_one_of(label, neighbours) && !is_one_of(label, resected); };
        if (labels[0] == labels[1] || !is_meshed(labels[0]) || !is_meshed(labels[1]))
            throw InvalidInput("labels " + std::to_string(labels[0]) + " and " + std::to_string(labels[1]) +
                               " cannot slide on one another: give two labels of the tissue that is meshed; along "
                               "rigid neighbours it slides anyway");
    }
}

namespace detail {

imaging::Volume smooth_distance(const imaging::Volume& labels) {
    imaging::Volume distance = imaging::signed_distance(imaging::mask_of_all(labels));
    distance.geometry.spacing.setOnes();
    distance = imaging::smooth(distance, NeighbourOptions().smoothing_voxels);
    distance.geometry = labels.geometry;
    return distance;
}

std::vector<int> not_meshed(const PrepareOptions& options) {
    std::vector<int> labels = options.rigid_neighbours;
    labels.insert(labels.end(), options.resected.begin(), options.resected.end());
    return labels;
}

imaging::Volume labels_alone(const imaging::Volume& map, const std::vector<int>& labels) {
    if (labels.empty()) return {};
    std::vector<int> others;
    for (const int label : imaging::labels_in(map))
        if (!is_one_of(label, labels)) others.push_back(label);
    return imaging::without_labels(map, others).as(CV_32S);
}

std::optional<RigidNeighbours> rigid_neighbours(const imaging::Volume& map, const std::vector<int>& labels) {
    if (labels.empty()) return std::nullopt;
    RigidNeighbours result{labels_alone(map, labels), {}};
    result.distance = smooth_distance(result.labels);
    return result;
}

imaging::Volume with_neighbours(const PreparedModel& prepared) {
    if (!prepared.neighbours && prepared.resected.empty()) return prepared.labels;
    imaging::Volume map = prepared.labels.as(CV_32S).clone();
    if (prepared.neighbours) map.voxels += prepared.neighbours->labels.as(CV_32S).voxels;
    if (!prepared.resected.empty()) map.voxels += prepared.resected.voxels;
    return map;
}

Intraoperative without_neighbours(const Intraoperative& seen, const std::vector<int>& labels) {
    Intraoperative result = seen;
    if (result.labels) result.labels = imaging::without_labels(*result.labels, labels);
    return result;
}

}  // namespace detail

}  // namespace tissuewarp::registration
