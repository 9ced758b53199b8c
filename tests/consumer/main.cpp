// The shortest use of the library: prepare a model from labels, update it from other labels, move points.

#include <tissuewarp/registration/field.hpp>
#include <tissuewarp/registration/update.hpp>

#include <cstdio>

using namespace tissuewarp;

namespace {

/// A ball of 30 mm radius, shifted along x.
imaging::Volume ball(double shift) {
    imaging::Geometry grid;
    grid.size = {44, 40, 40};
    grid.spacing = {2, 2, 2};
    grid.origin = {-44, -39, -39};
    imaging::Volume labels(grid, CV_32SC1);
    for (int k = 0; k < 40; ++k)
        for (int j = 0; j < 40; ++j)
            for (int i = 0; i < 44; ++i) {
                const Eigen::Vector3d x = grid.point({double(i), double(j), double(k)}) - Eigen::Vector3d(shift, 0, 0);
                labels.data<std::int32_t>()[labels.offset(i, j, k)] = x.norm() < 30;
            }
    return labels;
}

}  // namespace

int main() {
    registration::PrepareOptions options;
    options.meshing.edge_length = 12;
    const auto prepared = registration::prepare(ball(0), options);            // before the operation
    const auto result = registration::update(prepared, {.labels = ball(3)});  // during it
    const registration::PointTransform transform(result.deformation);
    const Eigen::Vector3d moved = transform(Eigen::Vector3d(10, 0, 0));
    std::printf("(10, 0, 0) went to (%.2f, %.2f, %.2f)\n", moved[0], moved[1], moved[2]);
    return std::abs(moved[0] - 13) < 0.5 ? 0 : 1;
}
