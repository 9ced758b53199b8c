#pragma once
/// Passes of the exact Euclidean distance transform of Felzenszwalb and Huttenlocher, "Distance transforms of sampled
/// functions", Theory of Computing 8 (2012): the lower envelope of parabolas, one axis after the other.

#include "imaging/volume.hpp"

namespace tissuewarp::imaging::detail {

/// Squared distances that no seed has reached.
constexpr float unreached = 1e30F;

/// Replaces every line f along `axis` (0 = i, 1 = j, 2 = k) by min over q of f(q) + (spacing (p - q))². float32, mm².
void parabola_pass(cv::Mat& squared, int axis, double spacing);

/// As parabola_pass where that leaves no more than reach_mm², in a fraction of its time for reaches of few voxels; more
/// than that elsewhere. Along j or k (axis 1 or 2).
void window_pass(cv::Mat& squared, int axis, double spacing, double reach_mm);

/// Squared distance (mm²) along one axis to the nearest voxel != 0 of a uint8 mask. float32; `unreached` where the
/// line has none.
cv::Mat squared_to_voxels(const cv::Mat& mask, int axis, double spacing);

/// Squared distance (mm²) along one axis to the nearest point halfway between a voxel of the mask and a neighbour
/// outside it. float32; `unreached` where the line has none.
cv::Mat squared_to_crossings(const cv::Mat& mask, int axis, double spacing);

}  // namespace tissuewarp::imaging::detail
