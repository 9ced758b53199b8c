#pragma once
/// Image processing that keeps geometry: functions from volume to volume. Lengths are physical (mm), so anisotropic
/// spacing is honoured; oblique axes do not matter to filters and are honoured by `resample`. Multi-threaded; the
/// result does not depend on the number of threads.

#include "imaging/volume.hpp"

#include <array>

namespace tissuewarp::imaging {

enum class Interpolation { Nearest, Linear };

/// Gaussian smoothing with standard deviation in mm. Result float32. Borders replicate.
Volume smooth(const Volume& image, double sigma_mm);

/// Resamples onto another grid. The input reaches half a voxel beyond its outermost centres; outside of that the result
/// is `outside`. Keeps the voxel type, rounding and saturating. Any channel count.
Volume resample(const Volume& image, const Geometry& grid, Interpolation interpolation, double outside = 0.0);

/// Gradient by central differences, in LPS: three channels float32, units of the image per mm.
Volume gradient(const Volume& image);

/// Binary morphology with a ball of a given radius in mm, on voxels != 0. Result uint8 of 0 and 1. What lies beyond the
/// edge of the image neither grows into it nor erodes it.
Volume dilate(const Volume& mask, double radius_mm);
Volume erode(const Volume& mask, double radius_mm);
Volume open(const Volume& mask, double radius_mm);
Volume close(const Volume& mask, double radius_mm);

/// Signed Euclidean distance in mm to the boundary of voxels != 0: negative inside, positive outside, the boundary
/// lying halfway between voxel centres along the grid: the distance to the nearest midpoint of a grid edge that
/// crosses it. Exact Euclidean transform (Felzenszwalb and Huttenlocher 2012) with anisotropic spacing. Result
/// float32. Where the mask meets the edge of the image there is no boundary. Throws InvalidInput when the mask is
/// empty or full.
Volume signed_distance(const Volume& mask);

/// Cuts the box of voxels [lower, upper) out of an image, geometry following.
Volume crop(const Volume& image, const std::array<int, 3>& lower, const std::array<int, 3>& upper);

}  // namespace tissuewarp::imaging
