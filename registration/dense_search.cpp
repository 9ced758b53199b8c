#include "registration/detail/dense_search.hpp"

#include "registration/detail/dense_force.hpp"
#include "registration/detail/pull.hpp"
#include "registration/detail/rasterisation.hpp"
#include "registration/detail/template_images.hpp"
#include "registration/field.hpp"

#include <Eigen/LU>

#include <algorithm>

namespace tissuewarp::registration::detail {

namespace {

/// 1 for the voxels of a grid whose centres lie in the mesh.
std::vector<std::uint8_t> voxels_in(const meshing::TetMesh& mesh, const imaging::Geometry& grid) {
    std::vector<std::uint8_t> inside(static_cast<std::size_t>(grid.voxel_count()));
    const Eigen::Matrix3Xd index = grid.point_to_index() * (mesh.nodes.colwise() - grid.origin);
    rasterise(index, mesh.tets, grid.size, [&](int, const Eigen::Vector4d&) {
        return [&](const TetRow& row) {
            const auto start = inside.begin() + grid.size[0] * (row.j + std::ptrdiff_t{grid.size[1]} * row.k);
            std::fill(start + row.first, start + row.last + 1, std::uint8_t{1});
        };
    });
    return inside;
}

/// ∂x/∂X of an element, its placement included.
Eigen::Matrix3d deformation_gradient(const meshing::TetMesh& mesh, const State& state, int tet) {
    const Eigen::Matrix<double, 3, 4> X = mesh.nodes(Eigen::all, mesh.tets.col(tet)),
                                      x = X + state.displacement(Eigen::all, mesh.tets.col(tet));
    const Eigen::Matrix3d rest = X.rightCols<3>().colwise() - X.col(0),
                          deformed = x.rightCols<3>().colwise() - x.col(0);
    return state.placement.linear() * deformed * rest.inverse();
}

/// A force on the moving grid, seen from the fixed image.
BlockMatch as_match(const DenseForce& force, const meshing::TetMesh& mesh, const State& state,
                    const meshing::Location& at) {
    const Eigen::Matrix3d F = deformation_gradient(mesh, state, at.tet), back = F.inverse();
    BlockMatch match;
    match.moving = force.place;
    match.fixed = state.placement * (force.place + displacement_at(mesh, state.displacement, at)) + F * force.shift;
    match.confidence = 1;
    match.information = back.transpose() * force.information * back;
    return match;
}

}  // namespace

DenseSearch::DenseSearch(const PreparedModel& prepared, const imaging::Volume& fixed)
    : prepared_(prepared), fixed_(fixed.as(CV_32F)), seen_(seen_region(fixed_)) {}

DenseMatches DenseSearch::matches(const State& state, int coarsening, const std::vector<BlockMatch>& known,
                                  const meshing::PointLocator& locator) const {
    const meshing::TetMesh& mesh = prepared_.model.mesh;
    const TemplateImages& images = prepared_.image->blocks.images();
    const int finest = images.options.levels - 1;
    const MatchingImage& moving = images.levels[static_cast<std::size_t>(std::max(0, finest - coarsening))];
    constexpr int reach = 8;  // voxels: those of the patches that the descriptors of a voxel on the surface compare
    const imaging::Volume field =
        displacement_near_mesh({mesh, state.displacement, state.placement}, GridSamples::with_rim(moving.grid), reach);
    const MatchingImage pulled_back = pulled_back_image(fixed_, seen_, moving.grid, images.region(moving.grid), field);
    const DenseForces dense = dense_forces(moving, pulled_back, voxels_in(mesh, moving.grid));
    DenseMatches result{{}, dense.agreement};
    for (const DenseForce& force : dense.forces)
        if (const auto at = locate_near(locator, force.place))
            result.matches.push_back(as_match(force, mesh, state, *at));
    std::copy_if(known.begin(), known.end(), std::back_inserter(result.matches),
                 [&](const BlockMatch& match) { return !dense.say_something_at(match.moving); });
    return result;
}

}  // namespace tissuewarp::registration::detail
