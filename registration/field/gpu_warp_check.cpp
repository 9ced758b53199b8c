#include "registration/field/gpu_warp_check.hpp"

#include "core/errors.hpp"
#include "registration/field/rasterisation.hpp"
#include "registration/warp.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace tissuewarp::registration::detail {

namespace {

using imaging::Geometry;
using imaging::Volume;

/// Every n-th voxel of a grid along each axis, n being the least that leaves 32 768.
struct Samples {
    Geometry grid;
    int every = 1;

    explicit Samples(const Geometry& full) : grid(full) {
        while (grid.voxel_count() > 32768) {
            ++every;
            for (std::size_t axis = 0; axis < 3; ++axis) grid.size[axis] = (full.size[axis] + every - 1) / every;
        }
        grid.spacing *= every;
    }

    /// The samples' voxels of a volume on the full grid.
    [[nodiscard]] Volume of(const Volume& full) const {
        Volume result(grid, full.voxels.type());
        const std::size_t bytes = full.voxels.elemSize();
        std::uint8_t* target = result.voxels.data;
        for (int k = 0; k < grid.size[2]; ++k)
            for (int j = 0; j < grid.size[1]; ++j)
                for (int i = 0; i < grid.size[0]; ++i, target += bytes) {
                    const auto from = static_cast<std::size_t>(full.offset(every * i, every * j, every * k));
                    std::copy_n(full.voxels.data + bytes * from, bytes, target);
                }
        return result;
    }
};

/// X − y of the voxels of `grid`: −u(X) − shift inside the mesh, where y = X + u(X) + shift, and −shift outside.
Volume field_of(const meshing::TetMesh& mesh, const Eigen::Matrix3Xd& displacement, const Eigen::Vector3d& shift,
                const Geometry& grid) {
    const Eigen::Matrix3Xd deformed = (mesh.nodes + displacement).colwise() + shift;
    const Eigen::Matrix3Xd index = grid.point_to_index() * (deformed.colwise() - grid.origin);
    Volume field(grid, CV_32FC3);
    field.voxels.setTo(cv::Scalar(-shift[0], -shift[1], -shift[2]));
    std::vector<std::uint8_t> inside(field.voxels.total());
    rasterise(index, mesh.tets, grid.size, [&](int tet, const Eigen::Vector4d& step) {
        const Eigen::Matrix<double, 3, 4> corners = displacement(Eigen::all, mesh.tets.col(tet));
        return [&, corners, step](const TetRow& row) {
            for (int i = row.first; i <= row.last; ++i) {
                const std::int64_t voxel = field.offset(i, row.j, row.k);
                if (std::exchange(inside[static_cast<std::size_t>(voxel)], std::uint8_t{1})) continue;
                const Eigen::Vector3d value = -(corners * (row.at_first + step * (i - row.first))) - shift;
                for (int c = 0; c < 3; ++c) field.data<cv::Vec3f>()[voxel][c] = static_cast<float>(value[c]);
            }
        };
    });
    return field;
}

/// Voxels of which a component differs by more than the bound, or is not a number.
std::int64_t count_beyond(double bound, const Volume& a, const Volume& b) {
    const Volume x = a.as(CV_64F), y = b.as(CV_64F);
    std::int64_t count = 0;
    const auto channels = static_cast<std::size_t>(x.channels());
    for (std::size_t voxel = 0; voxel < x.voxels.total(); ++voxel) {
        bool same = true;
        for (std::size_t c = channels * voxel; c < channels * (voxel + 1); ++c)
            same = same && std::abs(x.data<double>()[c] - y.data<double>()[c]) <= bound;
        count += !same;
    }
    return count;
}

void require_few(std::int64_t different, const Volume& samples, const GpuWarp& warp, const char* what) {
    if (200 * different <= static_cast<std::int64_t>(samples.voxels.total())) return;
    throw GpuUnavailable(warp.device() + " computes another " + what + " than the CPU at " + std::to_string(different) +
                         " of " + std::to_string(samples.voxels.total()) +
                         " voxels; update its driver, take another device or warp on the CPU");
}

}  // namespace

void require_right(GpuWarp& warp, const meshing::TetMesh& mesh, const Volume& moving, const Geometry& output,
                   const GpuWarpOptions& options) {
    const Eigen::Matrix3d strain =
        (Eigen::Matrix3d() << 0.05, 0.02, -0.03, 0.01, -0.04, 0.02, 0.03, 0.01, 0.06).finished();
    const Eigen::Vector3d centre = 0.5 * (mesh.nodes.rowwise().minCoeff() + mesh.nodes.rowwise().maxCoeff());
    const Eigen::Vector3d middle =
        output.point(0.5 * Eigen::Vector3d(output.size[0] - 1, output.size[1] - 1, output.size[2] - 1));
    const Eigen::Matrix3Xd displacement = strain * (mesh.nodes.colwise() - centre);
    Eigen::Isometry3d placement = Eigen::Isometry3d::Identity();
    // Off by odd fractions of a voxel: halfway between two, float32 and double precision may round to different ones.
    const Eigen::Vector3d off_half = output.index_to_point() * Eigen::Vector3d(0.1371, 0.2113, 0.3179);
    placement.translation() = middle - centre + off_half;

    const Samples samples(output);
    const Volume field = field_of(mesh, displacement, placement.translation(), samples.grid);
    require_few(count_beyond(1e-3, samples.of(warp.field(displacement, placement)), field), field, warp, "field");
    const bool nearest = options.interpolation == imaging::Interpolation::Nearest;
    const Volume image = nearest ? warp_labels(moving, field) : warp_image(moving, field, options.outside);
    double least = 0, most = 0;
    cv::minMaxIdx(moving.voxels, &least, &most);
    const double bound = nearest ? 0.0 : std::max(1e-3 * (most - least), moving.voxels.depth() == CV_32F ? 0.0 : 1.0);
    require_few(count_beyond(bound, samples.of(warp.warp(displacement, placement)), image), image, warp, "image");
}

}  // namespace tissuewarp::registration::detail
