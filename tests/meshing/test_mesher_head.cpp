// A real head from the repository's samples. imaging's reader is used where the build has it.

#include "imaging/image_io.hpp"
#include "meshing/mesher.hpp"
#include "meshing/quality.hpp"

#include <gtest/gtest.h>

#include <filesystem>

namespace tissuewarp::meshing {
namespace {

TEST(MesherHead, BrainVentriclesAndTumourAtSixMillimetres) {
    const imaging::Volume labels = imaging::read_labels(TISSUEWARP_SOURCE_DIR "/data/brainshift/preop_labels.nii.gz");
    MeshingOptions options;
    options.edge_length = 6.0;
    const TetMesh mesh = mesh_labels(labels, options);
    const QualityReport report = quality(mesh);
    EXPECT_GT(report.min_dihedral_deg.minimum, 8.0);
    EXPECT_NEAR(report.edge_mm.median, 6.0, 0.9);
    EXPECT_EQ(report.components, 1);
    const Fidelity result = fidelity(mesh, labels);
    EXPECT_EQ(result.volume_ratio.size(), 3U);
    EXPECT_NEAR(result.volume_ratio.at(1), 1.0, 0.03);
    EXPECT_NEAR(result.volume_ratio.at(2), 1.0, 0.05);
    EXPECT_NEAR(result.volume_ratio.at(3), 1.0, 0.05);
    EXPECT_LT(result.mean_surface_distance_mm, 0.5);
    EXPECT_LT(result.hausdorff_95_mm, 1.5);
}

TEST(MesherHead, TorsoKeepsEveryLabel) {
    const imaging::Volume labels = imaging::read_labels(TISSUEWARP_SOURCE_DIR "/data/torso/labels.nii.gz");
    MeshingOptions options;
    options.edge_length = 8.0;
    const TetMesh mesh = mesh_labels(labels, options);
    for (const auto& [label, ratio] : fidelity(mesh, labels).volume_ratio) EXPECT_GT(ratio, 0.0) << "label " << label;
    EXPECT_GT(quality(mesh).min_dihedral_deg.minimum, 3.0);
}

}  // namespace
}  // namespace tissuewarp::meshing
