#include "meshing/primitives.hpp"
#include "meshing/surface_voxels.hpp"

#include <gtest/gtest.h>

namespace tissuewarp::meshing {
namespace {

imaging::Geometry grid_of(int size) {
    imaging::Geometry grid;
    grid.size = {size, size, size};
    return grid;
}

SurfaceMesh box(double from, double to) {
    SurfaceMesh surface = boundary_surface(box_mesh(Eigen::Vector3d::Constant(to - from), {3, 3, 3})).surface;
    surface.nodes.array() += from;
    return surface;
}

SurfaceMesh together(const SurfaceMesh& a, const SurfaceMesh& b) {
    SurfaceMesh both;
    both.nodes.resize(3, a.nodes.cols() + b.nodes.cols());
    both.nodes << a.nodes, b.nodes;
    both.triangles.resize(3, a.triangles.cols() + b.triangles.cols());
    both.triangles << a.triangles, (b.triangles.array() + a.node_count()).matrix();
    return both;
}

int count(const imaging::Volume& inside) {
    return cv::countNonZero(inside.voxels.reshape(1, 1));
}

TEST(SurfaceVoxels, AreThoseWhoseCentresLieInside) {
    EXPECT_EQ(count(voxels_inside(box(2.5, 8.5), grid_of(12))), 6 * 6 * 6);
    EXPECT_EQ(count(voxels_inside(box(-2.5, 4.5), grid_of(12))), 5 * 5 * 5) << "the grid cuts it";
    EXPECT_EQ(count(voxels_inside(box(20, 25), grid_of(12))), 0);
}

TEST(SurfaceVoxels, CountNodesThatLieOnRaysOnce) {
    // Nodes, edges and faces at voxel centres: each layer belongs to one side, nothing leaks along a row.
    EXPECT_EQ(count(voxels_inside(box(2, 8), grid_of(12))), 6 * 6 * 6);
}

TEST(SurfaceVoxels, OfAnInnerSurfaceAreACavity) {
    EXPECT_EQ(count(voxels_inside(together(box(1.5, 10.5), box(4.5, 7.5)), grid_of(12))), 9 * 9 * 9 - 3 * 3 * 3);
}

TEST(SurfaceVoxels, OfTheGridAboutABodyHaveItsVolume) {
    const SurfaceMesh surface = box(-30, 10);
    const ClosedSurface closed = closed_surface(surface);
    const imaging::Volume inside = voxels_inside(closed.mesh, grid_about(closed));
    EXPECT_NEAR(count(inside) * inside.geometry.voxel_volume(), closed.volume_mm3, 0.01 * closed.volume_mm3);
    EXPECT_NEAR(inside.geometry.spacing[0], 0.4, 1e-9);
}

}  // namespace
}  // namespace tissuewarp::meshing
