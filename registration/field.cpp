#include "registration/field.hpp"

#include "core/errors.hpp"
#include "meshing/point_location.hpp"
#include "registration/field/continuation.hpp"
#include "registration/field/growth.hpp"
#include "registration/field/rasterisation.hpp"
#include "registration/field/row_inverse.hpp"
#include "registration/field/sliding.hpp"
#include "registration/field/uninitialised.hpp"
#include "registration/field/voxel_jacobian.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <optional>
#include <string>

// Everything is computed in the moving frame, before the placement P: forward y = P (X + u(X)); backward, with
// z = P⁻¹ y = X + u(X), the same mesh at its deformed nodes carries w(z) = −u, and X = z + w(z).

namespace tissuewarp::registration {

namespace {

using imaging::Geometry;
using imaging::Volume;

void require_usable(const Deformation& deformation, const FieldOptions& options) {
    meshing::require_valid(deformation.mesh, "deformation");
    if (deformation.displacement.cols() != deformation.mesh.nodes.cols())
        throw InvalidInput("deformation: " + std::to_string(deformation.displacement.cols()) + " displacements for " +
                           std::to_string(deformation.mesh.node_count()) + " nodes; give one each");
    for (Eigen::Index n = 0; n < deformation.displacement.cols(); ++n)
        if (!deformation.displacement.col(n).allFinite())
            throw InvalidInput("deformation: the displacement of node " + std::to_string(n) + " is not finite");
    if (!deformation.placement.matrix().allFinite())
        throw InvalidInput("deformation: the placement is not finite; give a rigid motion");
    if (!(options.fade_mm >= 1.0 && options.fade_mm <= 1e4))
        throw InvalidInput("fade distance " + std::to_string(options.fade_mm) + " mm; give one from 1 to 10000 mm");
    if (!deformation.surroundings) return;
    if (!deformation.surroundings->motion.matrix().allFinite())
        throw InvalidInput("deformation: the motion of the surroundings is not finite; give a rigid motion");
    if (deformation.surroundings->rigid.voxels.type() != CV_8UC1)
        throw InvalidInput("deformation: the mask of rigid surroundings must be of uint8; give rigid_surroundings()");
    for (const Eigen::Isometry3d& motion : deformation.surroundings->bodies)
        if (!motion.matrix().allFinite())
            throw InvalidInput("deformation: the motion of a rigid body is not finite; give a rigid motion");
    if (double most = 0; cv::minMaxLoc(deformation.surroundings->rigid.voxels.reshape(1, 1), nullptr, &most),
                         most > 1.0 + double(deformation.surroundings->bodies.size()))
        throw InvalidInput("deformation: the mask of rigid surroundings holds " + std::to_string(int(most)) +
                           ", of no body that is there; give rigid_surroundings()");
}

/// Displacements of the mesh as what lies beside its surface has them, and what the surface itself has beyond that.
detail::NodalField beside_surface(const Deformation& deformation, const Eigen::Matrix3Xd& nodes,
                                  const meshing::BoundarySurface& boundary, const Eigen::Matrix3Xd& values) {
    const bool slides = deformation.surroundings && deformation.surroundings->slide;
    if (!slides) return {values};
    detail::NodalField field{detail::motion_across_surface(nodes, boundary, values)};
    field.slip = values - field.beside;
    return field;
}

/// Of a deformation whose placement is the motion far away.
detail::Continuation forward_continuation(const Deformation& deformation, double fade_mm) {
    const auto& mesh = deformation.mesh;
    const meshing::BoundarySurface boundary = meshing::boundary_surface(mesh);
    return {mesh.nodes, mesh.tets,
            boundary,   beside_surface(deformation, mesh.nodes, boundary, deformation.displacement),
            fade_mm,    detail::held_before(deformation)};
}

/// Relative displacements on a grid, and which voxels the mesh covers.
struct Raster {
    Volume values;                     // three channels float32, mm; of any value outside the mesh
    std::vector<std::uint8_t> inside;  // one per voxel
    detail::RasterCount count;

    /// A grid within the mesh needs no continuation.
    [[nodiscard]] bool full() const { return std::find(inside.begin(), inside.end(), 0) == inside.end(); }
};

Raster rasterise_mesh(const Eigen::Matrix3Xd& nodes, const Eigen::Matrix4Xi& tets, const Eigen::Matrix3Xd& values,
                      const Geometry& grid) {
    Raster raster{detail::uninitialised(grid, CV_32FC3),
                  std::vector<std::uint8_t>(static_cast<std::size_t>(grid.voxel_count())),
                  {}};
    const Eigen::Matrix3d to_index = grid.point_to_index();
    const Eigen::Matrix3Xd index = to_index * (nodes.colwise() - grid.origin);
    auto* target = raster.values.data<cv::Vec3f>();
    raster.count = detail::rasterise(index, tets, grid.size, [&](int tet, const Eigen::Vector4d& barycentric_step) {
        const Eigen::Matrix<double, 3, 4> corners = values(Eigen::all, tets.col(tet));
        const Eigen::Vector3d step = corners * barycentric_step;
        return [&, corners, step](const detail::TetRow& row) {
            const Eigen::Vector3d start = corners * row.at_first;
            for (int i = row.first; i <= row.last; ++i) {
                const std::int64_t voxel = grid.size[0] * (row.j + std::int64_t{grid.size[1]} * row.k) + i;
                if (raster.inside[static_cast<std::size_t>(voxel)]) continue;
                raster.inside[static_cast<std::size_t>(voxel)] = 1;
                const Eigen::Vector3d value = start + step * (i - row.first);
                for (int c = 0; c < 3; ++c) target[voxel][c] = static_cast<float>(value[c]);
            }
        };
    });
    // Seen by a left-handed grid every volume has the other sign.
    if (to_index.determinant() < 0.0)
        raster.count.inverted = static_cast<int>(tets.cols()) - raster.count.flat - raster.count.inverted;
    return raster;
}

/// Gives the voxels around the mesh the mean of those next to them that have a value, `count` layers of them.
void grow(Raster& raster, int count) {
    const Geometry& grid = raster.values.geometry;
    const std::array<std::int64_t, 3> stride{1, grid.size[0], std::int64_t{grid.size[0]} * grid.size[1]};
    auto* values = raster.values.data<cv::Vec3f>();
    for (const auto& layer : detail::growth_layers(raster.inside, grid.size, count))
        tbb::parallel_for(std::size_t{0}, layer.size(), [&](std::size_t n) {
            const auto& [voxel, neighbours] = layer[n];
            cv::Vec3f sum(0, 0, 0);
            for (std::size_t axis = 0; axis < 3; ++axis) {
                if (neighbours & 1U << 2 * axis) sum += values[voxel - stride[axis]];
                if (neighbours & 2U << 2 * axis) sum += values[voxel + stride[axis]];
            }
            values[voxel] = sum / float(std::popcount(neighbours));
            raster.inside[voxel] = 1;
        });
}

/// Replaces v by `rotation` v + `linear` p + `constant` at every voxel centre p of `grid`, in double precision; voxels
/// outside the mesh first take outside_of_row()(i, q), with one such function for each row of voxels, called in
/// ascending order, and q the voxel centre in the moving frame.
template <class Outside>
void complete(Raster& raster, const Geometry& grid, const Eigen::Matrix3d& rotation, const Eigen::Matrix3d& linear,
              const Eigen::Vector3d& constant, const Outside& outside_of_row) {
    const Geometry moving = raster.values.geometry;
    const Eigen::Vector3d step = linear * grid.index_to_point().col(0), moving_step = moving.index_to_point().col(0);
    auto* values = raster.values.data<cv::Vec3f>();
    tbb::parallel_for(0, grid.size[1] * grid.size[2], [&](int row) {
        const int j = row % grid.size[1], k = row / grid.size[1];
        const Eigen::Vector3d start = linear * grid.point(Eigen::Vector3d(0, j, k)) + constant;
        const Eigen::Vector3d moving_start = moving.point(Eigen::Vector3d(0, j, k));
        std::optional<decltype(outside_of_row())> outside;  // a covered grid has nothing to make it from
        for (int i = 0; i < grid.size[0]; ++i) {
            const std::int64_t voxel = raster.values.offset(i, j, k);
            Eigen::Vector3d value;
            if (raster.inside[static_cast<std::size_t>(voxel)]) {
                value = Eigen::Vector3d(values[voxel][0], values[voxel][1], values[voxel][2]);
            } else {
                if (!outside) outside.emplace(outside_of_row());
                value = (*outside)(i, moving_start + i * moving_step);
            }
            const Eigen::Vector3d total = rotation * value + (start + i * step);
            for (int c = 0; c < 3; ++c) values[voxel][c] = static_cast<float>(total[c]);
        }
    });
    raster.values.geometry = grid;
}

}  // namespace

Volume displacement_moving_to_fixed(const Deformation& given, const Geometry& moving_grid, const FieldOptions& options,
                                    Observer& observer) {
    constexpr auto stage = "field moving to fixed";
    imaging::require_valid(moving_grid, "moving grid");
    require_usable(given, options);
    const Deformation deformation = given.with_placement(given.far_motion());
    const auto& mesh = deformation.mesh;
    observer.checkpoint(stage, 0.0);
    Raster raster = rasterise_mesh(mesh.nodes, mesh.tets, deformation.displacement, moving_grid);
    observer.checkpoint(stage, 0.2);
    std::optional<detail::Continuation> continuation;
    if (!raster.full()) continuation.emplace(forward_continuation(deformation, options.fade_mm));
    observer.checkpoint(stage, 0.6);
    const Eigen::Matrix3d rotation = deformation.placement.linear();
    complete(raster, moving_grid, rotation, rotation - Eigen::Matrix3d::Identity(), deformation.placement.translation(),
             [&] { return [&](int, const Eigen::Vector3d& X) { return (*continuation)(X); }; });
    observer.progress(stage, 1.0);
    return raster.values;
}

Volume displacement_near_mesh(const Deformation& deformation, const Geometry& moving_grid, int reach) {
    imaging::require_valid(moving_grid, "moving grid");
    require_usable(deformation, {});
    const auto& mesh = deformation.mesh;
    Raster raster = rasterise_mesh(mesh.nodes, mesh.tets, deformation.displacement, moving_grid);
    grow(raster, reach);
    const Eigen::Matrix3d rotation = deformation.placement.linear();
    complete(raster, moving_grid, rotation, rotation - Eigen::Matrix3d::Identity(), deformation.placement.translation(),
             [] { return [](int, const Eigen::Vector3d&) -> Eigen::Vector3d { return Eigen::Vector3d::Zero(); }; });
    return raster.values;
}

Volume displacement_fixed_to_moving(const Deformation& given, const Geometry& fixed_grid, const FieldOptions& options,
                                    Observer& observer) {
    constexpr auto stage = "field fixed to moving";
    imaging::require_valid(fixed_grid, "fixed grid");
    require_usable(given, options);
    const Deformation deformation = given.with_placement(given.far_motion());
    const auto& mesh = deformation.mesh;
    const Eigen::Isometry3d to_moving = deformation.placement.inverse();
    Geometry grid = fixed_grid;  // the fixed grid seen from the moving frame
    grid.origin = to_moving * fixed_grid.origin;
    grid.direction = to_moving.linear() * fixed_grid.direction;

    observer.checkpoint(stage, 0.0);
    const Eigen::Matrix3Xd deformed = mesh.nodes + deformation.displacement, inverse = -deformation.displacement;
    Raster raster = rasterise_mesh(deformed, mesh.tets, inverse, grid);
    if (raster.count.inverted + raster.count.flat > 0)
        observer.note("field fixed to moving: " + std::to_string(raster.count.inverted) + " inverted and " +
                      std::to_string(raster.count.flat) + " flat tetrahedra; the field folds there");
    observer.checkpoint(stage, 0.15);
    const meshing::BoundarySurface boundary = meshing::boundary_surface(mesh);
    std::optional<detail::Continuation> forward;
    detail::LazyContinuation backward([&] {
        return detail::Continuation(deformed, mesh.tets, boundary,
                                    beside_surface(deformation, deformed, boundary, inverse), options.fade_mm,
                                    detail::held_after(deformation));
    });
    const Eigen::Matrix3d identity = Eigen::Matrix3d::Identity(), linear = to_moving.linear() - identity;
    if (deformation.surroundings) {  // tissue parts from them: the forward field leaves gaps, where it has no inverse
        complete(raster, fixed_grid, identity, linear, to_moving.translation(),
                 [&] { return [&](int, const Eigen::Vector3d& z) { return backward(z); }; });
    } else {
        if (!raster.full())
            forward.emplace(mesh.nodes, mesh.tets, boundary, detail::NodalField{deformation.displacement},
                            options.fade_mm);
        observer.checkpoint(stage, 0.6);
        complete(raster, fixed_grid, identity, linear, to_moving.translation(),
                 [&] { return detail::RowInverse(*forward, backward); });
    }
    observer.progress(stage, 1.0);
    return raster.values;
}

struct PointTransform::Impl {
    Deformation deformation;
    meshing::PointLocator locator;
    detail::LazyContinuation continuation;  // points of the organ alone need none

    Impl(const Deformation& given, const FieldOptions& options)
        : deformation(given.with_placement(given.far_motion())),
          locator(deformation.mesh),
          continuation([this, options] { return forward_continuation(deformation, options.fade_mm); }) {}

    [[nodiscard]] Eigen::Vector3d operator()(const Eigen::Vector3d& point) {
        const auto location = locator.find(point);
        const Eigen::Vector3d displacement =
            location ? Eigen::Vector3d(deformation.displacement(Eigen::all, deformation.mesh.tets.col(location->tet)) *
                                       location->barycentric)
                     : continuation(point);
        return deformation.placement * (point + displacement);
    }
};

PointTransform::PointTransform(const Deformation& deformation, const FieldOptions& options) {
    require_usable(deformation, options);
    impl_ = std::make_unique<Impl>(deformation, options);
}
PointTransform::~PointTransform() = default;
PointTransform::PointTransform(PointTransform&&) noexcept = default;
PointTransform& PointTransform::operator=(PointTransform&&) noexcept = default;

Eigen::Matrix3Xd PointTransform::operator()(const Eigen::Matrix3Xd& points) const {
    if (!points.allFinite()) throw InvalidInput("point transform: a coordinate is not finite; remove that point");
    Eigen::Matrix3Xd mapped(3, points.cols());
    tbb::parallel_for(Eigen::Index{0}, points.cols(), [&](Eigen::Index p) { mapped.col(p) = (*impl_)(points.col(p)); });
    return mapped;
}

std::vector<bool> PointTransform::inside(const Eigen::Matrix3Xd& points) const {
    std::vector<bool> result;
    for (const auto& point : points.colwise()) result.push_back(impl_->locator.find(point).has_value());
    return result;
}

Volume jacobian_determinant(const Volume& displacement) {
    if (displacement.voxels.type() != CV_32FC3)
        throw InvalidInput("Jacobian: the field must have three channels of float32; give a displacement field");
    const Geometry& grid = displacement.geometry;
    const detail::VoxelJacobian jacobian(displacement);
    Volume result(grid, CV_32FC1);
    auto* target = result.data<float>();
    tbb::parallel_for(0, grid.size[2], [&](int k) {
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i) target[result.offset(i, j, k)] = jacobian.determinant({i, j, k});
    });
    return result;
}

}  // namespace tissuewarp::registration
