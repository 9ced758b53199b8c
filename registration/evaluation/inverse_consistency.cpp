#include "registration/evaluation/inverse_consistency.hpp"

#include "core/errors.hpp"
#include "imaging/vector_sampling.hpp"

#include <tbb/parallel_for.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

namespace tissuewarp::registration {

namespace {

using imaging::Geometry;
using imaging::Volume;

constexpr double left_the_grid = -1;

std::vector<std::int64_t> chosen_voxels(const Geometry& grid, const Volume* mask) {
    const Volume chosen = mask ? Volume(grid, cv::Mat(mask->voxels != 0)) : Volume();
    std::vector<std::int64_t> voxels;
    for (std::int64_t n = 0; n < grid.voxel_count(); ++n)
        if (!mask || chosen.data<std::uint8_t>()[n]) voxels.push_back(n);
    return voxels;
}

Eigen::Vector3d centre_of(const Geometry& grid, std::int64_t voxel) {
    const std::int64_t row = voxel / grid.size[0];
    return grid.point(
        Eigen::Vector3d(double(voxel % grid.size[0]), double(row % grid.size[1]), double(row / grid.size[1])));
}

}  // namespace

InverseConsistency inverse_consistency(const Volume& forward, const Volume& backward, const Volume* mask) {
    if (forward.voxels.type() != CV_32FC3)
        throw InvalidInput("inverse consistency: the forward field must be float32 of three components");
    const Geometry& grid = forward.geometry;
    if (mask && !imaging::same_grid(mask->geometry, grid))
        throw InvalidInput("inverse consistency: the mask lies on another grid; resample it onto that of the field");
    const imaging::VectorSampler back(backward);
    const std::vector<std::int64_t> voxels = chosen_voxels(grid, mask);
    std::vector<double> errors(voxels.size());
    tbb::parallel_for(std::size_t{0}, voxels.size(), [&](std::size_t n) {
        const cv::Vec3f& u = forward.data<cv::Vec3f>()[voxels[n]];
        const Eigen::Vector3d there(u[0], u[1], u[2]), carried = centre_of(grid, voxels[n]) + there;
        if (carried.allFinite() && !back.contains(carried))
            errors[n] = left_the_grid;
        else
            errors[n] = (there + back.value(carried)).norm();
    });
    InverseConsistency result;
    std::vector<double> kept;
    for (std::size_t n = 0; n < errors.size(); ++n) {
        if (!std::isfinite(errors[n]))
            throw InvalidInput("inverse consistency: a field is not finite at or near the image of voxel " +
                               std::to_string(voxels[n]) + "; repair the field");
        if (errors[n] == left_the_grid)
            ++result.left;
        else
            kept.push_back(errors[n]);
    }
    if (kept.empty())
        throw InvalidInput("inverse consistency: none of " + std::to_string(voxels.size()) +
                           " voxels stays in the grid of the backward field; give the two fields of one registration");
    result.error = summarise(std::move(kept));
    return result;
}

}  // namespace tissuewarp::registration
