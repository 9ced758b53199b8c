#include "label_shapes.hpp"
#include "meshing/mesher.hpp"
#include "meshing/quality.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <map>
#include <numbers>

namespace tissuewarp::meshing {
namespace {

using imaging::Geometry;
using imaging::Volume;

const Eigen::Vector3d middle(22, 22, 22);

MeshingOptions with_edge(double edge) {
    MeshingOptions options;
    options.edge_length = edge;
    return options;
}

const TetMesh& balls() {
    static const TetMesh mesh = mesh_labels(paint(grid(45), two_balls(middle)), with_edge(4.0));
    return mesh;
}

double ball_volume(double radius) {
    return 4.0 / 3.0 * std::numbers::pi * radius * radius * radius;
}

double voxel_volume(const Volume& labels, int label) {
    const auto* voxels = labels.data<int>();
    return labels.geometry.voxel_volume() *
           static_cast<double>(std::count(voxels, voxels + labels.geometry.voxel_count(), label));
}

/// Mean distance of the faces between two labels from the centre.
double mean_radius(const TetMesh& mesh, int inner, int outer, const Eigen::Vector3d& centre) {
    double sum = 0.0;
    int count = 0;
    for (const InterfaceFace& face : interface_faces(mesh)) {
        if (face.inner != inner || face.outer != outer) continue;
        for (int node : face.nodes) sum += (mesh.nodes.col(node) - centre).norm();
        count += 3;
    }
    return count > 0 ? sum / count : -1.0;
}

/// Nodes of the inner and outer sphere lie where they should, whatever the image's axes.
void expect_two_balls(const Volume& labels, const Eigen::Vector3d& centre, double tolerance,
                      double inner_ratio = 0.05) {
    const TetMesh mesh = mesh_labels(labels, with_edge(4.0));
    EXPECT_NO_THROW(require_valid(mesh, "balls"));
    EXPECT_NEAR(mean_radius(mesh, 7, 3, centre), 9.0, tolerance);
    EXPECT_NEAR(mean_radius(mesh, 3, 0, centre), 18.0, tolerance);
    EXPECT_LT(mean_radius(mesh, 7, 0, centre), 0.0);  // the inner ball does not reach the outside
    const auto volumes = quality(mesh).label_volume_mm3;
    EXPECT_NEAR(volumes.at(7) / voxel_volume(labels, 7), 1.0, inner_ratio);
    EXPECT_NEAR(volumes.at(3) / voxel_volume(labels, 3), 1.0, 0.03);
    EXPECT_NEAR((volumes.at(3) + volumes.at(7)) / ball_volume(18.0), 1.0, 0.03);
}

TEST(Mesher, BallInBallHasTheRightVolumesAndInterfaces) {
    expect_two_balls(paint(grid(45), two_balls(middle)), middle, 0.35);
}

TEST(Mesher, BallInBallIsGoodForExplicitDynamics) {
    const QualityReport report = quality(balls());
    EXPECT_GT(report.min_dihedral_deg.minimum, 8.0);
    EXPECT_LT(report.max_dihedral_deg.maximum, 172.0);
    EXPECT_NEAR(report.edge_mm.median, 4.0, 0.6);
    EXPECT_GT(report.edge_mm.minimum, 0.8);
    EXPECT_GT(report.step_limit_mm, 0.05 * 4.0);
    EXPECT_EQ(report.components, 1);
}

TEST(Mesher, EdgesFollowTheTarget) {
    const Volume labels = paint(grid(45), two_balls(middle));
    for (double edge : {3.0, 6.0})
        EXPECT_NEAR(quality(mesh_labels(labels, with_edge(edge))).edge_mm.median / edge, 1.0, 0.2);
}

TEST(Mesher, LabelsMayHaveTheirOwnEdge) {
    MeshingOptions options = with_edge(6.0);
    options.label_edge_length[7] = 2.5;
    const TetMesh mesh = mesh_labels(paint(grid(45), two_balls(middle)), options);
    double inner = 0.0, outer = 0.0;
    const Eigen::VectorXd volumes = tet_volumes(mesh);
    int inner_count = 0, outer_count = 0;
    for (int t = 0; t < mesh.tet_count(); ++t) {
        (mesh.labels[t] == 7 ? inner : outer) += volumes[t];
        ++(mesh.labels[t] == 7 ? inner_count : outer_count);
    }
    EXPECT_GT(outer / outer_count, 3.0 * inner / inner_count);
}

TEST(Mesher, InterfaceIsConforming) {
    // Closed: every edge of the inner sphere's faces is shared by exactly two of them.
    std::map<std::pair<int, int>, int> edges;
    for (const InterfaceFace& face : interface_faces(balls())) {
        if (face.inner != 7) continue;
        for (int k = 0; k < 3; ++k) {
            const int a = face.nodes[k], b = face.nodes[(k + 1) % 3];
            ++edges[{std::min(a, b), std::max(a, b)}];
        }
    }
    ASSERT_FALSE(edges.empty());
    for (const auto& [edge, count] : edges) EXPECT_EQ(count, 2);
}

TEST(Mesher, UsesEveryNode) {
    std::vector<char> used(static_cast<std::size_t>(balls().node_count()), 0);
    for (int node : balls().tets.reshaped()) used[static_cast<std::size_t>(node)] = 1;
    EXPECT_EQ(std::count(used.begin(), used.end(), 0), 0);
}

TEST(Mesher, SameInputGivesTheSameMesh) {
    const TetMesh again = mesh_labels(paint(grid(45), two_balls(middle)), with_edge(4.0));
    EXPECT_EQ(again.nodes, balls().nodes);
    EXPECT_EQ(again.tets, balls().tets);
    EXPECT_EQ(again.labels, balls().labels);
}

TEST(Mesher, ParallelRefinementMakesAMeshAsGoodAsTheSequentialOne) {
    const Volume labels = paint(grid(45), two_balls(middle));
    MeshingOptions options = with_edge(3.0);
    const TetMesh sequential = mesh_labels(labels, options);
    options.refinement = Refinement::Parallel;
    const TetMesh parallel = mesh_labels(labels, options);
    EXPECT_NO_THROW(require_valid(parallel, "balls"));
    EXPECT_NEAR(mean_radius(parallel, 7, 3, middle), 9.0, 0.35);
    EXPECT_NEAR(mean_radius(parallel, 3, 0, middle), 18.0, 0.35);
    EXPECT_NEAR(static_cast<double>(parallel.tet_count()) / sequential.tet_count(), 1.0, 0.15);
    const QualityReport report = quality(parallel);
    EXPECT_GT(report.min_dihedral_deg.minimum, 8.0);
    EXPECT_NEAR(report.edge_mm.median, 3.0, 0.45);
    EXPECT_EQ(report.components, 1);
    const Fidelity reached = fidelity(parallel, labels), expected = fidelity(sequential, labels);
    EXPECT_LT(reached.mean_surface_distance_mm, 1.1 * expected.mean_surface_distance_mm);
    EXPECT_LT(reached.hausdorff_95_mm, 1.1 * expected.hausdorff_95_mm);
}

TEST(Mesher, ObliqueAxesLandAtTheirPlaceInThePatient) {
    Geometry geometry = grid(45);
    geometry.direction = oblique();
    geometry.origin << -31, 12, 407;
    const Eigen::Vector3d centre = geometry.point(middle);
    expect_two_balls(paint(geometry, two_balls(centre)), centre, 0.35);
}

TEST(Mesher, LeftHandedAxesGivePositiveTetrahedra) {
    Geometry geometry = grid(45);
    geometry.direction = oblique() * Eigen::Vector3d(1, 1, -1).asDiagonal();
    geometry.origin << 5, -60, 33;
    const Eigen::Vector3d centre = geometry.point(middle);
    expect_two_balls(paint(geometry, two_balls(centre)), centre, 0.35);
}

TEST(Mesher, AnisotropicVoxelsKeepTheShape) {
    Geometry geometry;
    geometry.size = {60, 45, 18};
    geometry.spacing << 0.75, 1.0, 2.5;
    const Eigen::Vector3d centre = geometry.point(Eigen::Vector3d(29.5, 22, 8.5));
    // Smoothing by 0.8 voxels is 2 mm along the thick slices: a ball of 9 mm loses more than with cubes.
    expect_two_balls(paint(geometry, two_balls(centre)), centre, 0.5, 0.08);
}

TEST(Mesher, LabelsAtTheBorderOfTheImageAreClosed) {
    const Volume full = paint(grid(20), [](const Eigen::Vector3d&) { return 1; });
    const TetMesh mesh = mesh_labels(full, with_edge(4.0));
    EXPECT_NEAR(quality(mesh).label_volume_mm3.at(1) / 8000.0, 1.0, 0.04);
    const Eigen::Vector3d low = mesh.nodes.rowwise().minCoeff(), high = mesh.nodes.rowwise().maxCoeff();
    for (int axis = 0; axis < 3; ++axis) {
        EXPECT_NEAR(low[axis], -0.5, 0.5);  // the faces of the outermost voxels
        EXPECT_NEAR(high[axis], 19.5, 0.5);
    }
}

TEST(Mesher, FindsEveryPieceOfEveryLabel) {
    // Ten separate balls of radius 4 mm, two labels by turns, and a plate one voxel thick.
    const auto shape = [](const Eigen::Vector3d& p) {
        if (std::abs(p[2] - 52.0) < 0.6 && p[0] > 10 && p[0] < 50 && p[1] > 10 && p[1] < 50) return 9;
        for (int b = 0; b < 10; ++b)
            if ((p - Eigen::Vector3d(8 + 11 * (b % 5), 12 + 24 * (b / 5), 12 + 5 * (b % 3))).norm() < 4.0)
                return 4 + b % 2;
        return 0;
    };
    const Volume labels = paint(grid(60), shape);
    const TetMesh mesh = mesh_labels(labels, with_edge(3.0));
    const QualityReport report = quality(mesh);
    ASSERT_EQ(report.label_volume_mm3.size(), 3U);
    EXPECT_NEAR(report.label_volume_mm3.at(4) / voxel_volume(labels, 4), 1.0, 0.2);
    EXPECT_NEAR(report.label_volume_mm3.at(5) / voxel_volume(labels, 5), 1.0, 0.2);
    EXPECT_GT(report.label_volume_mm3.at(9), 0.5 * voxel_volume(labels, 9));  // below the size of one element
}

TEST(Mesher, MeshesOnlyTheLabelsAskedFor) {
    MeshingOptions options = with_edge(4.0);
    options.labels = {7};
    const TetMesh mesh = mesh_labels(paint(grid(45), two_balls(middle)), options);
    EXPECT_THAT(std::vector<int>(mesh.labels.begin(), mesh.labels.end()), testing::Each(7));
    EXPECT_NEAR(mean_radius(mesh, 7, 0, middle), 9.0, 0.35);
}

TEST(Mesher, RefusesWhatCannotBeMeshed) {
    const Volume labels = paint(grid(10), [](const Eigen::Vector3d& p) { return p[0] < 5 ? 1 : 0; });
    const auto refuses = [&](const Volume& volume, const MeshingOptions& options, const char* part) {
        try {
            mesh_labels(volume, options);
            ADD_FAILURE() << "accepted: " << part;
        } catch (const InvalidInput& error) {
            EXPECT_THAT(error.what(), testing::HasSubstr(part));
        }
    };
    refuses(labels, with_edge(0.0), "edge_length");
    refuses(labels, with_edge(-2.0), "edge_length");
    refuses(labels, with_edge(1e-4), "million");
    MeshingOptions options;
    options.labels = {3};
    refuses(labels, options, "label 3");
    options = {};
    options.facet_angle = 45;
    refuses(labels, options, "facet_angle");
    refuses(paint(grid(10), [](const Eigen::Vector3d&) { return 0; }), {}, "empty");
    refuses(paint(grid(10), [](const Eigen::Vector3d& p) { return p[0] < 5 ? -1 : 0; }), {}, "-1");
    refuses(labels.as(CV_32F), {}, "integers");
}

TEST(Mesher, StopsWhenAsked) {
    struct Impatient : Observer {
        int polls = 0;
        bool cancel_requested() override { return ++polls > 8; }
    };
    MeshingOptions options = with_edge(2.0);
    for (const Refinement refinement : {Refinement::Deterministic, Refinement::Parallel}) {
        options.refinement = refinement;
        Impatient observer;
        EXPECT_THROW(mesh_labels(paint(grid(45), two_balls(middle)), options, observer), Cancelled);
        EXPECT_EQ(observer.polls, 9);  // nothing ran on after the request
    }
}

struct Listener : Observer {
    void note(std::string_view message) override { notes.emplace_back(message); }
    std::vector<std::string> notes;
};

TEST(Mesher, LabelsThatAreMostlyLostAreNotedOrRefused) {
    const auto plane = [](const Eigen::Vector3d& p) { return std::abs(p[2] - 22.0) < 0.6 ? 1 : 0; };
    const auto on_a_block = [&](const Eigen::Vector3d& p) { return p[2] < 15.0 ? 2 : plane(p); };
    testing::internal::CaptureStderr();
    EXPECT_THROW(mesh_labels(paint(grid(45), plane), with_edge(12.0)), InvalidInput);
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "");  // CGAL has its own words
    Listener listener;
    mesh_labels(paint(grid(45), on_a_block), with_edge(12.0), listener);
    EXPECT_THAT(listener.notes, testing::Contains(testing::AllOf(testing::HasSubstr("of label 1 "),
                                                                 testing::HasSubstr("give it an edge length below"))));
}

TEST(Mesher, LabelsInThousandsOfPiecesAreNoted) {
    Listener listener;
    Volume labels(grid(45), CV_32S);
    for (int k = 0; k < 45; ++k)
        for (int j = 0; j < 45; ++j)
            for (int i = 0; i < 45; ++i) {
                const bool block = i < 20 && j < 20 && k < 20;
                const bool speck = i > 21 && i % 2 == 0 && j % 2 == 0 && k % 2 == 0;
                labels.data<int>()[labels.offset(i, j, k)] = block || speck ? 1 : 0;
            }
    mesh_labels(labels, with_edge(12.0), listener);
    ASSERT_FALSE(listener.notes.empty());
    EXPECT_THAT(listener.notes[0], testing::HasSubstr("label 1 lies in 6349 pieces"));
}

}  // namespace
}  // namespace tissuewarp::meshing
