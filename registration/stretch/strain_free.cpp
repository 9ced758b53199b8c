#include "registration/stretch/strain_free.hpp"

#include "core/errors.hpp"
#include "imaging/sampling.hpp"

#include <tbb/parallel_for.h>

#include <cmath>
#include <utility>

namespace tissuewarp::registration::detail {

namespace {

using Eigen::Vector3d;

/// Same axes and spacings about all that the map makes of the grid.
imaging::Geometry grid_about(const imaging::Geometry& grid, const Eigen::Affine3d& map) {
    Eigen::AlignedBox3d box;
    for (int corner = 0; corner < 8; ++corner) {
        Vector3d index;
        for (int axis = 0; axis < 3; ++axis)
            index[axis] = (corner >> axis & 1) ? grid.size[static_cast<std::size_t>(axis)] - 1 : 0;
        box.extend(grid.index(map * grid.point(index)));
    }
    imaging::Geometry result = grid;
    const Vector3d first = box.min().array().floor();
    const Vector3d last = box.max().array().ceil();
    result.origin = grid.point(first);
    for (int axis = 0; axis < 3; ++axis)
        result.size[static_cast<std::size_t>(axis)] = static_cast<int>(last[axis] - first[axis]) + 1;
    return result;
}

imaging::Volume labels_under(const imaging::Volume& given, const Eigen::Affine3d& map) {
    const imaging::Volume labels = given.as(CV_32S);
    imaging::Volume result(grid_about(labels.geometry, map), CV_32SC1);
    const imaging::Geometry& grid = result.geometry;
    const Eigen::Affine3d back = map.inverse();
    auto* out = result.data<std::int32_t>();
    tbb::parallel_for(0, grid.size[2], [&](int k) {
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i)
                out[result.offset(i, j, k)] =
                    imaging::nearest_value<std::int32_t>(labels, back * grid.point({double(i), double(j), double(k)}));
    });
    return result;
}

/// How far planes across the normal part under the map, per distance before: 1/|A⁻ᵀ n|.
double growth_along(const Eigen::Matrix3d& linear, const Vector3d& normal) {
    return 1 / (linear.inverse().transpose() * normal).norm();
}

}  // namespace

PreparedModel strain_free_under(const PreparedModel& prepared, const Eigen::Affine3d& map, Observer& observer) {
    if (!(map.linear().determinant() > 0)) throw InvalidInput("a prior deformation must not turn tissue inside out");
    meshing::TetMesh mesh = prepared.model.mesh;
    mesh.nodes = map * mesh.nodes;
    PrepareOptions options = prepared.options;
    options.element = prepared.model.element;
    PreparedModel result = prepare(std::move(mesh), labels_under(prepared.labels, map), options, observer);
    // Those of the labels as given are exact; those of resampled ones are off by their voxels.
    const auto& given = prepared.interfaces.nodes();
    for (std::size_t i = 0; i < given.size(); ++i)
        result.interfaces.nodes()[i].offset = given[i].offset * growth_along(map.linear(), given[i].normal);
    return result;
}

}  // namespace tissuewarp::registration::detail
