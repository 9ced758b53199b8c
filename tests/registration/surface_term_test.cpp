/// Points of a part of a surface: normals, the pose from anywhere, the tissue that follows.
#include "meshing/search/surface_tree.hpp"
#include "registration/field.hpp"
#include "registration/pose/rigid_part.hpp"
#include "registration/pose/surface_data.hpp"
#include "registration/pose/surface_pose.hpp"
#include "registration/springs/ground_springs.hpp"
#include "registration/update.hpp"
#include "tests/registration/doubt_codes.hpp"
#include "tests/registration/shapes.hpp"
#include "tests/support/label_shapes.hpp"
#include "tests/support/numbers.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

namespace tissuewarp::registration {
namespace {

using Eigen::Vector3d;
using meshing::SurfaceTree;
using tissuewarp::test::Numbers;

/// A pear with a flat side: no rotation brings it near itself.
Vector3d pear(const Vector3d& unit) {
    const double bulge = 1 + 0.35 * unit[0];
    return {50 * unit[0] + 6 * unit[1] * unit[1], 36 * bulge * unit[1], 28 * bulge * unit[2] * (unit[2] < 0 ? 0.6 : 1)};
}

meshing::SurfaceMesh pear_surface(int cells) {
    auto surface = meshing::boundary_surface(test::ball({0, 0, 0}, 1, cells)).surface;
    for (auto node : surface.nodes.colwise()) node = pear(Vector3d(node));
    return surface;
}

Vector3d normal_of(const meshing::SurfaceMesh& surface, Eigen::Index t) {
    const Eigen::Matrix3d corners = surface.nodes(Eigen::all, surface.triangles.col(t));
    return (corners.col(1) - corners.col(0)).cross(corners.col(2) - corners.col(0)).normalized();
}

/// Points seen on the part of a surface that faces `towards` best.
SurfacePoints seen_part(const meshing::SurfaceMesh& surface, const Vector3d& towards, double share, int count,
                        double deviation_mm, double outliers, Numbers& numbers, bool with_normals) {
    std::vector<Eigen::Index> order(static_cast<std::size_t>(surface.triangle_count()));
    std::iota(order.begin(), order.end(), Eigen::Index{0});
    const auto height = [&](Eigen::Index t) {
        return surface.nodes(Eigen::all, surface.triangles.col(t)).rowwise().mean().dot(towards);
    };
    std::sort(order.begin(), order.end(), [&](auto a, auto b) { return height(a) > height(b); });
    order.resize(static_cast<std::size_t>(share * double(order.size())));
    SurfacePoints seen{Eigen::Matrix3Xd(3, count), Eigen::Matrix3Xd(3, with_normals ? count : 0), deviation_mm};
    for (int n = 0; n < count; ++n) {
        const auto t = order[static_cast<std::size_t>(numbers.between(0, 0.999999) * double(order.size()))];
        const double root = std::sqrt(numbers.between(0, 1)), along = numbers.between(0, 1);
        const Vector3d weights(1 - root, root * (1 - along), root * along);
        seen.points.col(n) =
            surface.nodes(Eigen::all, surface.triangles.col(t)) * weights + deviation_mm * numbers.noise();
        if (numbers.between(0, 1) < outliers) seen.points.col(n) += numbers.between(5, 25) * numbers.direction();
        if (with_normals) seen.normals.col(n) = (normal_of(surface, t) + 0.1 * numbers.noise()).normalized();
    }
    return seen;
}

SurfacePoints moved(SurfacePoints seen, const Eigen::Isometry3d& motion) {
    seen.points = motion * seen.points;
    seen.normals = motion.linear() * seen.normals;
    return seen;
}

TEST(SurfaceData, NormalsAndAreasOfANoisyPatch) {
    const double radius = 40;
    Numbers numbers(2);
    const auto sphere = meshing::boundary_surface(test::ball({0, 0, 0}, radius, 12)).surface;
    const auto seen = seen_part(sphere, {0, 0, 1}, 0.4, 1500, 0.5, 0.05, numbers, false);
    const detail::SurfaceData data = detail::surface_data(seen);
    ASSERT_EQ(data.count(), 1500);
    EXPECT_FALSE(data.oriented);
    int straight = 0;
    for (Eigen::Index n = 0; n < data.count(); ++n)
        straight += std::abs(data.normals.col(n).dot(data.points.col(n).normalized())) > std::cos(15 * EIGEN_PI / 180);
    EXPECT_GT(straight, 0.94 * 1500);  // outliers and their neighbours aside
    const double area = 0.4 * 4 * EIGEN_PI * radius * radius;
    EXPECT_NEAR(data.areas.sum() / area, 1, 0.1);
    EXPECT_LT(data.areas.maxCoeff(), 2.1 * area / 1500);  // a lone outlier stands for no more than others
}

TEST(SurfaceData, DenseCloudsAreThinned) {
    Numbers numbers(3);
    const auto seen = seen_part(pear_surface(8), {0, 0, 1}, 0.3, 20000, 0.3, 0, numbers, true);
    const detail::SurfaceData data = detail::surface_data(seen, 2000);
    EXPECT_LE(data.count(), 2000);
    EXPECT_GT(data.count(), 1000);
    EXPECT_TRUE(data.oriented);
}

/// Mean distance of two placements of a surface, mm.
double pose_error(const meshing::SurfaceMesh& surface, const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
    return ((a * surface.nodes) - (b * surface.nodes)).colwise().norm().mean();
}

class FarStarts : public ::testing::TestWithParam<int> {};

INSTANTIATE_TEST_SUITE_P(Seeds, FarStarts, ::testing::Range(1, 7));

/// 30 % of the surface, 30° and 40 mm off, up to 30 % outliers, with normals and without.
TEST_P(FarStarts, ThePoseIsFoundFromAPart) {
    const auto surface = pear_surface(10);
    Numbers numbers(100 + static_cast<unsigned>(GetParam()));
    const double outliers = GetParam() % 2 ? 0.3 : 0.05;
    const auto seen = seen_part(surface, numbers.direction(), 0.3, 1200, 0.7, outliers, numbers, GetParam() % 4 < 2);
    const auto truth = test::motion(30, numbers.direction(), 40 * numbers.direction());
    const Alignment found = align_surfaces(surface, moved(seen, truth));
    EXPECT_LT(pose_error(surface, found.placement, truth), 0.91);  // started about 45 mm off
}

TEST(SurfacePose, ASecondPlaceThatFitsAsWellIsSaid) {
    Numbers numbers(5);
    const auto surface = meshing::boundary_surface(test::box_at({-40, -25, -15}, {80, 50, 30}, {8, 5, 3})).surface;
    const auto seen = seen_part(surface, {0, 0, 1}, 0.1, 600, 0.5, 0, numbers, true);  // a flat side: it can slide
    const SurfaceTree tree(surface);
    const auto pose = detail::search_surface_pose(tree, surface, detail::surface_data(seen), {}, silent_observer());
    EXPECT_GT(pose.pose.rival_mm, 8);
    EXPECT_LT(pose.pose.rival_cost - pose.pose.chosen.cost, 0.01);
}

/// Every half turn brings an ellipsoid onto itself: what the points cannot tell the headers do, within 30 mm or so.
TEST(SurfacePose, ASmoothOrganIsNotTurnedOver) {
    auto surface = meshing::boundary_surface(test::ball({0, 0, 0}, 1, 10)).surface;
    for (auto node : surface.nodes.colwise()) node = Vector3d(60 * node[0], 45 * node[1], 36 * node[2]);
    for (unsigned seed = 1; seed <= 6; ++seed) {
        Numbers numbers(seed);
        const auto seen = seen_part(surface, numbers.direction(), 0.35, 1000, 0.7, 0.05, numbers, true);
        const auto truth = test::motion(10, numbers.direction(), 12 * numbers.direction());
        const Alignment found = align_surfaces(surface, moved(seen, truth));
        EXPECT_LT(pose_error(surface, found.placement, truth), 12) << seed;  // turned over: 60 mm and more
    }
}

TEST(RigidPart, GoesToThePlacementAndMovesNothing) {
    PrepareOptions coarse;
    coarse.meshing.edge_length = 12;
    const PreparedModel prepared = prepare(shapes::organ_labels({}), coarse);
    const Eigen::Matrix3Xd& nodes = prepared.model.mesh.nodes;
    const auto turn = test::motion(20, {1, -2, 1}, {9, 4, -7});
    detail::State state{test::motion(15, {0, 1, 1}, {30, 20, 10}), (turn * nodes) - nodes};
    state.displacement.row(0).array() += 0.02 * nodes.row(1).array().square() / 10;  // a bend
    const Eigen::Matrix3Xd before = state.placement * (nodes + state.displacement);
    const auto surface = detail::ground_springs(prepared, 1, [](const InterfaceNode&) { return 1.0; });
    detail::give_rigid_part_to_placement(nodes, surface, state);
    EXPECT_LT((state.placement * (nodes + state.displacement) - before).cwiseAbs().maxCoeff(), 1e-9);
    EXPECT_LT(state.displacement.colwise().norm().maxCoeff(), 1.82);  // of more than 15
    const detail::State once = state;
    detail::give_rigid_part_to_placement(nodes, surface, state);
    EXPECT_LT((state.displacement - once.displacement).cwiseAbs().maxCoeff(), 1e-9);
}

UpdateOptions on_cpu() {
    UpdateOptions options;
    options.device = Device::Cpu;
    return options;
}

PrepareOptions coarse() {
    PrepareOptions options;
    options.meshing.edge_length = 9;
    return options;
}

TEST(SurfaceTerm, ASurfaceThatDidNotChangeLeavesTheTissueInPeace) {
    Numbers numbers(6);
    const auto prepared = prepare(shapes::organ_labels({}), coarse());
    auto ellipsoid = meshing::boundary_surface(test::ball({0, 0, 0}, 1, 12)).surface;
    ellipsoid.nodes = shapes::Organ{}.semi_axes.asDiagonal() * ellipsoid.nodes;
    const auto seen = seen_part(ellipsoid, {0, 1, 0}, 0.4, 1500, 0.5, 0.1, numbers, true);
    UpdateOptions options = on_cpu();
    options.align = false;
    const auto result = update(prepared, {.surface = seen}, options);
    EXPECT_LT(result.deformation.displacement.colwise().norm().maxCoeff(), 0.66);  // two deviations of a point
    EXPECT_GT(result.surface->inlier_share, 0.9);
    EXPECT_TRUE(result.doubts.empty());
}

TEST(SurfaceTerm, PointsOfAnotherOrganAreDoubted) {
    Numbers numbers(7);
    const auto prepared = prepare(shapes::organ_labels({}), coarse());
    auto small = pear_surface(8);
    small.nodes *= 0.35;
    const auto seen = seen_part(small, {1, 1, 0}, 0.7, 1000, 0.3, 0.3, numbers, true);
    EXPECT_FALSE(update(prepared, {.surface = seen}, on_cpu()).doubts.empty());
}

// A patch of a smooth organ fits elsewhere as well; where the headers hold, it need not tell where the organ lies.
TEST(SurfaceTerm, ASmallPatchDoesNotTellWhereAnOrganLies) {
    const auto prepared = prepare(shapes::organ_labels({}), coarse());
    const auto said = [&](double share, bool align) {
        Numbers numbers(9);
        const auto seen = seen_part(pear_surface(8), {0, 1, 0}, share, 500, 0.5, 0, numbers, true);
        UpdateOptions options = on_cpu();
        options.align = align;
        const auto doubts = test::codes(update(prepared, {.surface = seen}, options).doubts);
        return std::count(doubts.begin(), doubts.end(), "surface.too_small") > 0;
    };
    EXPECT_TRUE(said(0.1, true));
    EXPECT_FALSE(said(0.1, false));
    EXPECT_FALSE(said(0.4, true));
}

// A search of the pose puts such a patch on the other side of the organ.
TEST(SurfaceTerm, NormalsThatPointInwardsAreSaid) {
    const auto prepared = prepare(shapes::organ_labels({}), coarse());
    auto ellipsoid = meshing::boundary_surface(test::ball({0, 0, 0}, 1, 12)).surface;
    ellipsoid.nodes = shapes::Organ{}.semi_axes.asDiagonal() * ellipsoid.nodes;
    for (const double sign : {1.0, -1.0}) {
        Numbers numbers(9);
        auto seen = moved(seen_part(ellipsoid, {0, 1, 0}, 0.2, 800, 0.5, 0.05, numbers, true),
                          test::motion(0, {1, 0, 0}, {0, -6, 0}));  // sunken
        seen.normals *= sign;
        const auto doubts = test::codes(update(prepared, {.surface = seen}, on_cpu()).doubts);
        EXPECT_EQ(std::count(doubts.begin(), doubts.end(), "surface.normals_inward"), sign < 0);
    }
}

TEST(SurfaceTerm, PointsFarFromAModelThatMayNotMoveAreRefused) {
    Numbers numbers(8);
    const auto prepared = prepare(shapes::organ_labels({}), coarse());
    const auto seen = moved(seen_part(pear_surface(8), {0, 1, 0}, 0.3, 500, 0.5, 0, numbers, true),
                            test::motion(0, {1, 0, 0}, {300, 0, 0}));
    UpdateOptions options = on_cpu();
    options.align = false;
    EXPECT_THROW(update(prepared, {.surface = seen}, options), InvalidInput);
}

}  // namespace
}  // namespace tissuewarp::registration
