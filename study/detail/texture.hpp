#pragma once
/// What tissue looks like to a scanner.

#include "study/detail/smooth_noise.hpp"

#include "imaging/volume.hpp"

#include <tbb/parallel_for.h>

#include <array>
#include <vector>

namespace tissuewarp::study::detail {

/// A grey value as a function of where tissue was at rest, between 20 and 200 or so: a level for each label, structure
/// of 3 to 24 mm, and vessels.
class Texture {
public:
    explicit Texture(Random& random);
    double operator()(const Eigen::Vector3d& point, int label) const;
    /// 1 in the middle of a vessel, 0 off it.
    [[nodiscard]] double vessel(const Eigen::Vector3d& point) const;

private:
    std::array<double, 3> levels_{};
    std::vector<SmoothValues> octaves_;
    SmoothValues one_, other_;
};

/// float32: value(LPS point) at each voxel, in all threads.
template <class Value>
imaging::Volume filled(const imaging::Geometry& grid, const Value& value) {
    imaging::Volume image(grid, CV_32FC1);
    auto* voxels = image.data<float>();
    const std::int64_t slice = std::int64_t{grid.size[0]} * grid.size[1];
    tbb::parallel_for(0, grid.size[2], [&](int k) {
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i)
                voxels[slice * k + std::int64_t{grid.size[0]} * j + i] =
                    static_cast<float>(value(grid.point({double(i), double(j), double(k)})));
    });
    return image;
}

/// Rician.
imaging::Volume noisy(const imaging::Volume& clean, double deviation, Random& random);

/// By an angle up to `most_deg` about an axis in any direction.
Eigen::Matrix3d small_turn(double most_deg, Random& random);

}  // namespace tissuewarp::study::detail
