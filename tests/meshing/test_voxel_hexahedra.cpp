#include "core/errors.hpp"
#include "label_shapes.hpp"
#include "meshing/voxel_hexahedra.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

namespace tissuewarp::meshing {
namespace {

using Eigen::Vector3d;

// Oblique and anisotropic, of either handedness.
imaging::Geometry oblique_grid(bool left_handed) {
    imaging::Geometry geometry = grid(24, {1.5, 2.0, 2.5});
    geometry.direction = oblique();
    if (left_handed) geometry.direction.col(1) *= -1;
    geometry.origin = {-30, 12, 100};
    return geometry;
}

imaging::Volume ball(const imaging::Geometry& geometry) {
    const Vector3d centre = geometry.point({11.5, 11.5, 11.5});
    return paint(geometry, [&](const Vector3d& p) {
        return (p - centre).norm() < 8 ? 7 : (p - centre).norm() < 15 ? 3 : 0;
    });
}

TEST(VoxelHexahedra, OneForEachVoxelInPlace) {
    for (const bool left_handed : {false, true}) {
        const imaging::Volume labels = ball(oblique_grid(left_handed));
        const MixedMesh mesh = voxel_hexahedra(labels);
        ASSERT_NO_THROW(require_valid(mesh.mesh.nodes, mesh.hexahedra, "voxels"));
        EXPECT_LT((hex_volumes(mesh.mesh.nodes, mesh.hexahedra).array() - 7.5).abs().maxCoeff(), 1e-9);
        int voxel = 0;
        for (int k = 0; k < 24; ++k)
            for (int j = 0; j < 24; ++j)
                for (int i = 0; i < 24; ++i) {
                    const int label = labels.data<int>()[labels.offset(i, j, k)];
                    if (label == 0) continue;
                    ASSERT_LT(voxel, mesh.hexahedra.count());
                    const HexCorners corners = hex_corners(mesh.mesh.nodes, mesh.hexahedra, voxel);
                    EXPECT_LT((corners.rowwise().mean() - labels.geometry.point(Vector3d(i, j, k))).norm(), 1e-10);
                    EXPECT_EQ(mesh.hexahedra.labels[voxel], label);
                    ++voxel;
                }
        EXPECT_EQ(voxel, mesh.hexahedra.count());
        Eigen::VectorXi uses = Eigen::VectorXi::Zero(mesh.mesh.node_count());
        for (const int node : mesh.hexahedra.hexes.reshaped()) ++uses[node];
        EXPECT_GT(uses.minCoeff(), 0);
    }
}

TEST(VoxelHexahedra, CoarseningKeepsTheVolume) {
    const imaging::Volume labels = ball(oblique_grid(true));
    for (const int coarsening : {2, 3, 5}) {
        const MixedMesh mesh = voxel_hexahedra(labels, {.coarsening = coarsening});
        ASSERT_NO_THROW(require_valid(mesh.mesh.nodes, mesh.hexahedra, "voxels"));
        const double block = 7.5 * coarsening * coarsening * coarsening;
        const Eigen::VectorXd volumes = hex_volumes(mesh.mesh.nodes, mesh.hexahedra);
        EXPECT_LT((volumes.array() - block).abs().maxCoeff(), 1e-7);
        const double ball_volume = 4.0 / 3 * std::numbers::pi * 15 * 15 * 15;
        EXPECT_NEAR(volumes.sum(), ball_volume, 0.15 * ball_volume) << coarsening;
    }
}

TEST(VoxelHexahedra, MeshesTheLabelsAskedForAndRefusesWhatIsNotThere) {
    const imaging::Volume labels = ball(oblique_grid(false));
    const MixedMesh inner = voxel_hexahedra(labels, {.labels = {7}});
    EXPECT_TRUE((inner.hexahedra.labels.array() == 7).all());
    EXPECT_LT(inner.hexahedra.count(), voxel_hexahedra(labels).hexahedra.count());
    EXPECT_THROW(voxel_hexahedra(labels, {.labels = {4}}), InvalidInput);
    EXPECT_THROW(voxel_hexahedra(labels, {.coarsening = 0}), InvalidInput);
    EXPECT_THROW(voxel_hexahedra(labels, {.coarsening = 24, .labels = {7}}), InvalidInput);
    EXPECT_THROW(voxel_hexahedra(labels.as(CV_16S)), InvalidInput);
}

}  // namespace
}  // namespace tissuewarp::meshing
