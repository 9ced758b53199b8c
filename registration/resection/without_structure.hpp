#pragma once
/// What of an image has no structure: fluid and air in a cavity.

#include "imaging/volume.hpp"
#include "registration/resection/find_resection.hpp"

#include <vector>

namespace tissuewarp::registration::detail {

/// An image where a cavity may be, on one grid.
struct CavityView {
    imaging::Volume organ;        ///< uint8: tissue, and what is gone of it
    imaging::Volume grey;         ///< float32, smoothed against noise
    imaging::Volume deviation;    ///< of the grey values in a box about each voxel
    double tissue_deviation = 0;  ///< its median in tissue

    /// Of an image of one component on the grid of two masks; both are `organ` where nothing is known to be gone.
    CavityView(const imaging::Volume& image, imaging::Volume organ, const imaging::Volume& tissue);
    /// Of what is known of an image already.
    CavityView(imaging::Volume organ, imaging::Volume grey, imaging::Volume deviation, double tissue_deviation);
};

/// The grid of an image, not finer than the options have it, about points (3 × P, LPS mm) with a margin around them.
imaging::Geometry grid_about(const imaging::Geometry& image, const Eigen::Matrix3Xd& points, double margin_mm);

/// Smoothed so that noise does not look like structure, float32.
imaging::Volume against_noise(const imaging::Volume& image);

/// Half the length of a box along an axis: as many voxels, one at least.
int voxels_of_half(double half_mm, const imaging::Geometry& grid, std::size_t axis);

/// Means of an image (float32) over boxes of twice `half_mm`, and a voxel at least either way, about each voxel;
/// borders replicate.
imaging::Volume box_mean(const imaging::Volume& image, double half_mm);

/// Standard deviation of an image (float32) in a box about each voxel. Boxes, unlike Gaussians, see nothing of a wall
/// beyond them, however bright.
imaging::Volume local_deviation(const imaging::Volume& image);

std::vector<float> values_in(const imaging::Volume& image, const imaging::Volume& mask);
double median(std::vector<float> values);
/// Median, and the deviation that a normal distribution with the same median distance from it has.
struct Spread {
    double middle = 0, deviation = 0;
};
Spread spread_of(const std::vector<float>& values);

/// Pieces of a mask, largest first, of more than a volume.
std::vector<imaging::Volume> pieces_of(const imaging::Volume& mask, double least_ml);

/// A piece without structure up to its wall, within the organ: halfway between its grey and that of the organ about it.
imaging::Volume up_to_wall(const CavityView& view, const imaging::Volume& piece);

}  // namespace tissuewarp::registration::detail
