#pragma once
/// Segments with names, in layers that may overlap, to one label map.

#include "imaging/volume.hpp"

#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace tissuewarp::imaging::detail {

/// A segment is the voxels of one value in one layer (a component of the volume).
struct Segment {
    std::string name;
    int layer = 0;
    int value = 0;
};

struct SegmentMap {
    Volume labels;  ///< int32
    std::map<int, std::string> names;
    std::vector<std::string> notes;
};

/// Paints segments into one label map and counts the voxels that two of them claim.
class SegmentPainter {
public:
    explicit SegmentPainter(const Geometry& grid) : labels_(grid, CV_32S) {}

    void paint(std::int64_t voxel, int label) {
        int& painted = labels_.data<int>()[voxel];
        if (painted != 0 && painted != label) ++overlaps_[{painted, label}];
        painted = label;
    }
    /// The map. Throws InvalidInput where segments overlap, by name: a voxel has one label.
    [[nodiscard]] Volume disjoint(const std::filesystem::path& path, const std::map<int, std::string>& names) const;

private:
    Volume labels_;
    std::map<std::pair<int, int>, std::int64_t> overlaps_;
};

/// One label map of a layered volume (a component a layer, values 0 outside). Label values stay where no two segments
/// share one, and are numbered from 1 in the order of the file otherwise, with a note. Voxels that no segment names are
/// kept, with a note. Throws InvalidInput on overlaps and on values that are no labels.
SegmentMap collapse_layers(const Volume& layers, const std::vector<Segment>& segments,
                           const std::filesystem::path& path);

}  // namespace tissuewarp::imaging::detail
