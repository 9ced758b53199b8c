// A real head from the repository's samples. imaging's reader is used where the build has it.

#include "imaging/image_io.hpp"
#include "meshing/mesher.hpp"
#include "meshing/quality.hpp"
#include "tests/support/folders.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace tissuewarp::meshing {
namespace {

TEST(MesherHead, BrainVentriclesAndTumourAtSixMillimetres) {
    const imaging::Volume labels =
        imaging::read_labels(tissuewarp::test::source_folder() / "data/brainshift/preop_labels.nii.gz");
    MeshingOptions options;
    options.edge_length = 6.0;
    const TetMesh mesh = mesh_labels(labels, options);
    const QualityReport report = quality(mesh);
    EXPECT_GT(report.min_dihedral_deg.minimum, 10.8);  // 12.0
    EXPECT_NEAR(report.edge_mm.median, 6.0, 0.3);      // 6.24
    EXPECT_EQ(report.components, 1);
    const Fidelity result = fidelity(mesh, labels);
    EXPECT_EQ(result.volume_ratio.size(), 3U);
    EXPECT_NEAR(result.volume_ratio.at(1), 1.0, 0.03);
    EXPECT_NEAR(result.volume_ratio.at(2), 1.0, 0.05);
    EXPECT_NEAR(result.volume_ratio.at(3), 1.0, 0.05);
    EXPECT_LT(result.mean_surface_distance_mm, 0.19);  // 0.172
    EXPECT_LT(result.hausdorff_95_mm, 0.51);           // 0.462
}

TEST(MesherHead, TorsoKeepsEveryLabel) {
    const imaging::Volume labels = imaging::read_labels(tissuewarp::test::source_folder() / "data/torso/labels.nii.gz");
    MeshingOptions options;
    options.edge_length = 8.0;
    const TetMesh mesh = mesh_labels(labels, options);
    const Fidelity result = fidelity(mesh, labels);
    EXPECT_EQ(result.volume_ratio.size(), 41U);
    for (const auto& [label, ratio] : result.volume_ratio)
        EXPECT_GT(ratio, 0.088) << "label " << label;  // a voxel's: 0.098
    EXPECT_EQ(std::ranges::count_if(result.volume_ratio, [](const auto& entry) { return entry.second < 0.61; }), 1)
        << "0.685 for the next, thin bone";
    EXPECT_LT(result.mean_surface_distance_mm, 0.512);       // 0.465
    EXPECT_LT(result.hausdorff_95_mm, 1.86);                 // 1.69
    EXPECT_GT(quality(mesh).min_dihedral_deg.minimum, 9.1);  // 10.1
}

}  // namespace
}  // namespace tissuewarp::meshing
