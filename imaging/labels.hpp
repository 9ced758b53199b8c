#pragma once
/// Label maps: which labels are there, where, how much of them, in how many pieces. Label 0 is background.

#include "imaging/volume.hpp"

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <map>
#include <vector>

namespace tissuewarp::imaging {

struct LabelStatistics {
    int label = 0;
    std::int64_t voxels = 0;
    double volume_mm3 = 0.0;
    Eigen::Vector3d centroid = Eigen::Vector3d::Zero();  ///< LPS mm
    std::array<int, 3> lower{0, 0, 0};                   ///< bounding box, first voxel
    std::array<int, 3> upper{0, 0, 0};                   ///< bounding box, one past the last voxel
    int components = 0;                                  ///< 6-connected pieces
    bool touches_border = false;                         ///< meets the edge of the image
    double mean = 0.0, standard_deviation = 0.0;         ///< of the grey values, when an image was given
};

/// The labels present, ascending, background excluded.
std::vector<int> labels_in(const Volume& labels);

/// Statistics per label, background excluded. `image`, when given, must lie on the same grid.
std::map<int, LabelStatistics> label_statistics(const Volume& labels, const Volume* image = nullptr);

/// uint8 mask of one label, or of every label != 0.
Volume mask_of(const Volume& labels, int label);
Volume mask_of_all(const Volume& labels);

/// Volume of the voxels != 0; 0 for an empty mask.
double millilitres(const Volume& mask);

/// The map with these labels turned to background, int32; the map itself, not a copy, where none is given.
Volume without_labels(const Volume& labels, const std::vector<int>& which);

/// 6-connected components of voxels != 0, numbered from 1 in order of falling size. Result int32.
Volume connected_components(const Volume& mask);

/// The mask without every component but the largest.
Volume largest_component(const Volume& mask);

/// Throws InvalidInput with file-free wording when the map is empty, and when `required` labels are absent.
void require_labels(const Volume& labels, const std::vector<int>& required, const char* name);

}  // namespace tissuewarp::imaging
