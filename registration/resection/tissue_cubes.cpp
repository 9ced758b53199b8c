#include "registration/resection/tissue_cubes.hpp"

#include "registration/field/voxel_sampler.hpp"
#include "registration/resection/find_resection.hpp"
#include "registration/resection/without_counterpart.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace tissuewarp::registration::detail {

using Eigen::Vector3d;
using imaging::Volume;

namespace {

/// Along the LPS axes.
imaging::Geometry lattice_about(const Eigen::Matrix3Xd& points, double apart_mm) {
    const Vector3d lower = points.rowwise().minCoeff(), upper = points.rowwise().maxCoeff();
    imaging::Geometry grid;
    grid.spacing.setConstant(apart_mm);
    grid.origin = lower;
    for (Eigen::Index axis = 0; axis < 3; ++axis)
        grid.size[static_cast<std::size_t>(axis)] = 1 + static_cast<int>((upper[axis] - lower[axis]) / apart_mm);
    return grid;
}

/// From the middle of a cube to its 27 points, voxels of an image.
std::array<Vector3d, 27> points_of_cube(const imaging::Geometry& image) {
    std::array<Vector3d, 27> points;
    for (int n = 0; n < 27; ++n)
        points[static_cast<std::size_t>(n)] =
            image.point_to_index() * cavity_options.window_mm * Vector3d(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1);
    return points;
}

/// Mean and deviation of an image in a cube about a voxel index.
std::pair<double, double> spread_in_cube(const VoxelSampler<float>& sampler, const std::array<Vector3d, 27>& cube,
                                         const Vector3d& middle) {
    double sum = 0, squares = 0;
    for (const Vector3d& point : cube) {
        float value = 0;
        sampler.linear(middle + point, &value);
        sum += value;
        squares += double(value) * value;
    }
    const double mean = sum / 27;
    return {mean, std::sqrt(std::max(0.0, squares / 27 - mean * mean))};
}

/// Of an image in cubes about the places that `place` gives of each of `cubes`, whose voxels of the lattice are
/// `organ`.
template <class Cubes, class Place>
CavityView view_of(const Volume& image, const Volume& organ, const Cubes& cubes, const Place& place) {
    const Volume values = image.as(CV_32F);
    const VoxelSampler<float> sampler{values};
    const std::array<Vector3d, 27> cube = points_of_cube(values.geometry);
    Volume grey(organ.geometry, CV_32FC1), deviation(organ.geometry, CV_32FC1);
    tbb::parallel_for(std::size_t{0}, cubes.size(), [&](std::size_t n) {
        const auto [mean, spread] = spread_in_cube(sampler, cube, values.geometry.index(place(n)));
        grey.data<float>()[cubes[n].voxel] = float(mean);
        deviation.data<float>()[cubes[n].voxel] = float(spread);
    });
    const double in_organ = median(values_in(deviation, organ));
    return {organ, std::move(grey), std::move(deviation), in_organ};
}

}  // namespace

TissueCubes::TissueCubes(const meshing::TetMesh& mesh, const meshing::PointLocator& locator, const Volume& moving)
    : moving_({}, {}, {}, 0) {
    const imaging::Geometry grid = lattice_about(mesh.nodes, tissue_cubes_options.apart_mm);
    Volume organ(grid, CV_8UC1);
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i) {
                const Vector3d place = grid.point({double(i), double(j), double(k)});
                const auto in_mesh = locator.find(place);
                if (!in_mesh) continue;
                cubes_.push_back({organ.offset(i, j, k), place, *in_mesh});
                organ.data<std::uint8_t>()[cubes_.back().voxel] = 1;
            }
    moving_ = view_of(moving, organ, cubes_, [&](std::size_t n) { return cubes_[n].place; });
}

bool TissueCubes::may_be_gone(const Deformation& deformation, const Volume& fixed, const FieldOfView& view) const {
    std::vector<Vector3d> went(cubes_.size());
    tbb::parallel_for(std::size_t{0}, cubes_.size(), [&](std::size_t n) {
        const auto& [tet, barycentric] = cubes_[n].in_mesh;
        const Vector3d u = deformation.displacement(Eigen::all, deformation.mesh.tets.col(tet)) * barycentric;
        went[n] = deformation.placement * (cubes_[n].place + u);
    });
    Volume core =
        without_counterpart(view_of(fixed, moving_.organ, cubes_, [&](std::size_t n) { return went[n]; }), moving_);
    for (std::size_t n = 0; n < cubes_.size(); ++n)
        if (std::uint8_t& voxel = core.data<std::uint8_t>()[cubes_[n].voxel]; voxel && view.distance(went[n]) >= 0)
            voxel = 0;
    return !pieces_of(core, cavity_options.least_core_ml).empty();
}

}  // namespace tissuewarp::registration::detail
