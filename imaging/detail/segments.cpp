#include "imaging/detail/segments.hpp"

#include "core/errors.hpp"
#include "imaging/detail/header_checks.hpp"

#include <cmath>
#include <limits>
#include <set>

namespace tissuewarp::imaging::detail {

namespace {

using Key = std::pair<int, int>;  ///< layer, value

std::string quoted(const std::map<int, std::string>& names, int label) {
    const auto found = names.find(label);
    return found == names.end() ? "label " + std::to_string(label) : "'" + found->second + "'";
}

/// Every value but 0 of every layer that has voxels.
std::set<Key> keys_in(const cv::Mat& values, std::size_t voxels, std::size_t layers) {
    std::set<Key> keys;
    std::vector<int> last(layers, 0);
    const int* value = values.ptr<int>();
    for (std::size_t voxel = 0; voxel < voxels; ++voxel)
        for (std::size_t layer = 0; layer < layers; ++layer, ++value)
            if (*value != 0 && *value != last[layer]) keys.insert({static_cast<int>(layer), last[layer] = *value});
    return keys;
}

/// int32, refused where a value is no label.
cv::Mat whole_numbers(const Volume& layers, const std::filesystem::path& path) {
    const std::size_t count = layers.voxels.total() * static_cast<std::size_t>(layers.channels());
    cv::Mat values, doubles;
    layers.voxels.convertTo(values, CV_32S);
    layers.voxels.convertTo(doubles, CV_64F);
    for (std::size_t i = 0; i < count; ++i) {
        const double value = doubles.ptr<double>()[i];
        if (value < 0.0 || value != std::floor(value) || value > std::numeric_limits<int>::max()) {
            throw unusable(path,
                           "a layer holds the value " + all_digits(value) + "; labels are whole numbers from 0 on");
        }
    }
    return values;
}

/// Labels of the keys: their values where no two share one, numbers in the order of the file otherwise.
std::map<Key, int> numbered(const std::vector<Key>& order) {
    std::map<Key, int> labels;
    std::set<int> used;
    for (const Key& key : order) used.insert(key.second);
    const bool distinct = used.size() == order.size();
    for (std::size_t i = 0; i < order.size(); ++i)
        labels[order[i]] = distinct ? order[i].second : static_cast<int>(i) + 1;
    return labels;
}

std::string list_of(const std::map<int, std::string>& names) {
    std::string text;
    for (const auto& [label, name] : names)
        text += (text.empty() ? "" : ", ") + std::to_string(label) + " '" + name + "'";
    return text;
}

}  // namespace

Volume SegmentPainter::disjoint(const std::filesystem::path& path, const std::map<int, std::string>& names) const {
    if (overlaps_.empty()) return labels_;
    const auto& [pair, count] = *overlaps_.begin();
    throw unusable(path, "segments " + quoted(names, pair.first) + " and " + quoted(names, pair.second) +
                             " overlap in " + std::to_string(count) +
                             " voxels and a voxel has one label; remove one, or save them without overlap");
}

SegmentMap collapse_layers(const Volume& layers, const std::vector<Segment>& segments,
                           const std::filesystem::path& path) {
    const auto layer_count = static_cast<std::size_t>(layers.channels());
    const auto voxel_count = static_cast<std::size_t>(layers.geometry.voxel_count());
    const cv::Mat values = whole_numbers(layers, path);
    const std::set<Key> present = keys_in(values, voxel_count, layer_count);

    SegmentMap result;
    std::vector<Key> order;
    std::map<Key, std::string> names;
    std::string absent;
    for (const Segment& segment : segments) {
        const Key key{segment.layer, segment.value};
        if (segment.layer >= layers.channels()) {
            absent += (absent.empty() ? "'" : ", '") + segment.name + "'";
        } else if (names.emplace(key, segment.name).second) {
            order.push_back(key);
        } else {
            throw unusable(path, "segments '" + names[key] + "' and '" + segment.name + "' share the label value " +
                                     std::to_string(key.second) + " of one layer; correct the header");
        }
    }
    if (!absent.empty())
        result.notes.push_back("segments " + absent + " are of layers that the file does not hold: left out");
    for (const Key& key : present)
        if (!names.contains(key)) order.push_back(key);
    const std::map<Key, int> labels = numbered(order);

    std::string unnamed;
    bool renumbered = false;
    for (const auto& [key, label] : labels) {
        if (const auto name = names.find(key); name != names.end())
            result.names[label] = name->second;
        else
            unnamed += (unnamed.empty() ? "" : ", ") + std::to_string(label);
        renumbered |= label != key.second;
    }
    if (renumbered)
        result.notes.push_back("label values repeat in several layers: segments are numbered anew, " +
                               list_of(result.names));
    if (!unnamed.empty()) result.notes.push_back("labels without a segment of their own: " + unnamed);

    SegmentPainter painter(layers.geometry);
    const int* value = values.ptr<int>();
    for (std::size_t voxel = 0; voxel < voxel_count; ++voxel)
        for (std::size_t layer = 0; layer < layer_count; ++layer, ++value)
            if (*value != 0)
                painter.paint(static_cast<std::int64_t>(voxel), labels.at({static_cast<int>(layer), *value}));
    result.labels = painter.disjoint(path, result.names);
    return result;
}

}  // namespace tissuewarp::imaging::detail
