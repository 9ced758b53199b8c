// Scores by place: errors by depth and by distance to data, inverse consistency, and the residual of held-out data.
#include "registration/boundary/label_surface.hpp"
#include "registration/evaluation/inverse_consistency.hpp"
#include "registration/evaluation/surface_residual.hpp"
#include "registration/evaluation/target_bins.hpp"

#include "core/errors.hpp"
#include "shapes.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <random>

namespace tissuewarp::registration {
namespace {

using imaging::Geometry;
using imaging::Volume;

constexpr double infinity = std::numeric_limits<double>::infinity();

Volume ball_labels(const Geometry& grid, const Eigen::Vector3d& centre, double radius) {
    Volume labels(grid, CV_32SC1);
    test::for_each_voxel(labels, [&](const Eigen::Vector3d& index, std::int64_t n) {
        labels.data<std::int32_t>()[n] = (grid.point(index) - centre).norm() < radius ? 7 : 0;
    });
    return labels;
}

template <class Vector>
Volume field_of(const Geometry& grid, const Vector& u) {
    Volume field(grid, CV_32FC3);
    test::for_each_voxel(field, [&](const Eigen::Vector3d& index, std::int64_t n) {
        const Eigen::Vector3d d = u(grid.point(index));
        for (int c = 0; c < 3; ++c) field.data<cv::Vec3f>()[n][c] = static_cast<float>(d[c]);
    });
    return field;
}

TEST(ErrorBins, HoldTheErrorsOfTheirTargetsAndSayWhereThereAreNone) {
    const Eigen::VectorXd errors = Eigen::VectorXd::LinSpaced(5, 1.0, 5.0);
    Eigen::VectorXd depths(5);
    depths << 0.0, 4.999, 5.0, 30.0, 20.0;
    const auto bins = bin_errors(errors, depths, {5, 10, 20});
    ASSERT_EQ(bins.size(), 4U);  // nothing lies outside
    EXPECT_EQ(bins[0].error.count, 2);
    EXPECT_DOUBLE_EQ(bins[0].error.mean, 1.5);
    EXPECT_EQ(bins[1].error.count, 1);
    EXPECT_DOUBLE_EQ(bins[1].error.maximum, 3.0);
    EXPECT_EQ(bins[2].error.count, 0);
    EXPECT_EQ(bins[3].from, 20.0);
    EXPECT_EQ(bins[3].to, infinity);
    EXPECT_DOUBLE_EQ(bins[3].error.mean, 4.5);

    depths[3] = -infinity;
    const auto outside = bin_errors(errors, depths, {5});
    ASSERT_EQ(outside.size(), 3U);
    EXPECT_EQ(outside[0].from, -infinity);
    EXPECT_DOUBLE_EQ(outside[0].error.mean, 4.0);
}

TEST(ErrorBins, RefuseEdgesOutOfOrderAndCoordinatesThatAreNone) {
    const Eigen::VectorXd two = Eigen::VectorXd::Ones(2);
    for (const std::vector<double>& edges : std::vector<std::vector<double>>{{10, 5}, {5, 5}, {0}, {-1}, {infinity}})
        EXPECT_THROW((void)bin_errors(two, two, edges), InvalidInput);
    EXPECT_THROW((void)bin_errors(two, two * std::nan(""), {5}), InvalidInput);
    EXPECT_THROW((void)bin_errors(two, Eigen::VectorXd::Ones(3), {5}), InvalidInput);
}

// Depth in voxels, or along an axis of the grid, would be off by the spacing or the turn.
TEST(Depth, InABallIsItsRadiusLessTheDistanceFromTheCentre) {
    const Eigen::Vector3d centre(20, -30, 5);
    const Volume labels = ball_labels(test::oblique_grid(centre, {61, 55, 47}, {0.8, 1.0, 1.2}), centre, 18.0);
    std::mt19937 generator(2);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    Eigen::Matrix3Xd points(3, 300);
    Eigen::VectorXd expected(300);
    for (int n = 0; n < 300; ++n) {
        const Eigen::Vector3d direction =
            Eigen::Vector3d(uniform(generator), uniform(generator), uniform(generator)).normalized();
        const double radius = 9.0 + 13.0 * std::abs(uniform(generator));
        points.col(n) = centre + radius * direction;
        expected[n] = 18.0 - radius;
    }
    EXPECT_LT((depth_below_surface(labels, points) - expected).cwiseAbs().maxCoeff(), 0.7);
    // The boundary's midpoints scatter by a quarter of a voxel about the ball, and the nearest one counts.
    EXPECT_LT(std::abs((depth_below_surface(labels, points) - expected).mean()), 0.25);
    EXPECT_EQ(depth_below_surface(labels, centre + Eigen::Vector3d(100, 0, 0))[0], -infinity);
    EXPECT_THROW((void)depth_below_surface(Volume(labels.geometry, CV_32SC1), points), InvalidInput);
}

TEST(DistanceToData, IsThatOfTheNearestAmongAll) {
    std::mt19937 generator(4);
    std::normal_distribution<double> normal(0.0, 30.0);
    const auto draw = [&](int count) {
        return Eigen::Matrix3Xd::NullaryExpr(3, count, [&] { return normal(generator); }).eval();
    };
    const Eigen::Matrix3Xd points = draw(50), data = draw(400);
    const Eigen::VectorXd distances = distance_to_data(points, data);
    for (int p = 0; p < 50; ++p)
        EXPECT_DOUBLE_EQ(distances[p], (data.colwise() - points.col(p)).colwise().norm().minCoeff());
    EXPECT_THROW((void)distance_to_data(points, Eigen::Matrix3Xd(3, 0)), InvalidInput);
}

TEST(InverseConsistency, OfAnAffineMapAndItsInverseIsRounding) {
    const Eigen::Vector3d centre(3, 4, 5), shift(2, -1, 0.5);
    Eigen::Matrix3d gradient;
    gradient << 0.10, 0.02, 0, -0.03, -0.08, 0.01, 0, 0.04, 0.05;
    const Geometry small = test::oblique_grid(centre, {15, 13, 11}, {2, 2.5, 3});
    const Volume forward =
        field_of(small, [&](const Eigen::Vector3d& x) -> Eigen::Vector3d { return gradient * (x - centre) + shift; });
    const Eigen::Matrix3d back = (Eigen::Matrix3d::Identity() + gradient).inverse();
    const auto inverse = [&](const Eigen::Vector3d& y) -> Eigen::Vector3d {
        return centre + back * (y - centre - shift) - y;
    };
    const Geometry large = test::plain_grid({90, 90, 90}, 1.0, centre - Eigen::Vector3d::Constant(45));
    const InverseConsistency good = inverse_consistency(forward, field_of(large, inverse));
    EXPECT_EQ(good.left, 0);
    EXPECT_EQ(good.error.count, 15 * 13 * 11);
    EXPECT_LT(good.error.maximum, 2e-5);

    // An inverse that is 0.3 mm off is 0.3 mm off everywhere.
    const InverseConsistency off =
        inverse_consistency(forward, field_of(large, [&](const Eigen::Vector3d& y) -> Eigen::Vector3d {
                                return inverse(y) + Eigen::Vector3d(0, 0.3, 0);
                            }));
    EXPECT_NEAR(off.error.mean, 0.3, 1e-5);
    EXPECT_NEAR(off.error.percentile_95, 0.3, 2e-5);
}

TEST(InverseConsistency, CountsWhatLeavesAndRefusesWhatIsNoPair) {
    const Geometry grid = test::plain_grid({10, 10, 10});
    const Volume along = field_of(grid, [](const Eigen::Vector3d&) { return Eigen::Vector3d(4, 0, 0); });
    const Volume against = field_of(grid, [](const Eigen::Vector3d&) { return Eigen::Vector3d(-4, 0, 0); });
    const InverseConsistency result = inverse_consistency(along, against);
    EXPECT_EQ(result.left, 400);
    EXPECT_EQ(result.error.count, 600);
    EXPECT_EQ(result.error.maximum, 0.0);

    Volume mask(grid, CV_8UC1);
    mask.data<std::uint8_t>()[mask.offset(2, 2, 2)] = 1;
    EXPECT_EQ(inverse_consistency(along, against, &mask).error.count, 1);
    mask.voxels.setTo(0);
    EXPECT_THROW((void)inverse_consistency(along, against, &mask), InvalidInput);
    const Volume far = field_of(grid, [](const Eigen::Vector3d&) { return Eigen::Vector3d(40, 0, 0); });
    EXPECT_THROW((void)inverse_consistency(far, against), InvalidInput);
    Volume broken = against.clone();
    broken.data<cv::Vec3f>()[broken.offset(5, 5, 5)][1] = std::nanf("");
    EXPECT_THROW((void)inverse_consistency(along, broken), InvalidInput);
    EXPECT_THROW((void)inverse_consistency(broken, along), InvalidInput);
    EXPECT_THROW((void)inverse_consistency(along, Volume(grid, CV_32FC1)), InvalidInput);
}

double enclosed_volume(const meshing::SurfaceMesh& surface) {
    double six = 0;
    for (const auto& t : surface.triangles.colwise())
        six += surface.nodes.col(t[0]).dot(surface.nodes.col(t[1]).cross(surface.nodes.col(t[2])));
    return six / 6;
}

// Normals that point inward, or a grid's handedness taken for granted, would turn the volume's sign.
TEST(LabelSurface, OfABallIsClosedAndHalfAVoxelOffAtMost) {
    const Eigen::Vector3d centre(-12, 8, 33);
    const Geometry oblique = test::oblique_grid(centre, {51, 51, 41}, {1.0, 1.0, 1.25});
    Geometry right_handed = oblique;
    right_handed.direction.col(0) *= -1.0;
    right_handed.origin += centre - right_handed.point(Eigen::Vector3d(25, 25, 20));
    for (const Geometry& grid : {oblique, right_handed}) {
        const meshing::SurfaceMesh surface = label_surface(ball_labels(grid, centre, 18.0));
        const Eigen::RowVectorXd radii = (surface.nodes.colwise() - centre).colwise().norm();
        EXPECT_NEAR(radii.mean(), 18.0, 0.1);
        EXPECT_GT(radii.minCoeff(), 17.5);
        EXPECT_LT(radii.maxCoeff(), 18.5);
        EXPECT_NEAR(enclosed_volume({surface.nodes.colwise() - centre, surface.triangles}),
                    4.0 / 3.0 * EIGEN_PI * std::pow(18.0, 3), 0.02 * 24429);
        std::map<std::pair<int, int>, int> uses;
        for (const auto& t : surface.triangles.colwise())
            for (int k = 0; k < 3; ++k) ++uses[{t[k], t[(k + 1) % 3]}];
        for (const auto& [edge, count] : uses) {
            EXPECT_EQ(count, 1);
            EXPECT_EQ(uses.count({edge.second, edge.first}), 1U);
        }
    }
}

TEST(LabelSurface, IsOpenWhereTheImageCutsTheOrganAndAbsentWithoutOne) {
    const Geometry grid = test::plain_grid({30, 30, 30});
    const meshing::SurfaceMesh half = label_surface(ball_labels(grid, {15, 15, 0}, 10.0));
    const Eigen::RowVectorXd radii = (half.nodes.colwise() - Eigen::Vector3d(15, 15, 0)).colwise().norm();
    EXPECT_GT(radii.minCoeff(), 9.4);  // no lid at z = 0
    EXPECT_THROW((void)label_surface(Volume(grid, CV_32SC1)), InvalidInput);
    Volume full(grid, CV_32SC1);
    full.voxels.setTo(1);
    EXPECT_THROW((void)label_surface(full), InvalidInput);
}

TEST(SurfaceResidual, IsTheDistanceWithItsSign) {
    const Eigen::Vector3d centre(5, 5, 5);
    const auto boundary = meshing::boundary_surface(test::ball(centre, 20.0, 24)).surface;
    Eigen::Matrix3Xd outside(3, 60), within(3, 60);
    for (int n = 0; n < 60; ++n) {
        const Eigen::Vector3d direction(std::cos(n), std::sin(n), std::cos(3 * n));
        outside.col(n) = centre + 21.5 * direction.normalized();
        within.col(n) = centre + 18.0 * direction.normalized();
    }
    const SurfaceResidual out = surface_residual(boundary, outside), in = surface_residual(boundary, within);
    EXPECT_NEAR(out.distance.mean, 1.5, 0.1);
    EXPECT_NEAR(out.mean_signed_mm, 1.5, 0.1);
    EXPECT_NEAR(in.distance.median, 2.0, 0.1);
    EXPECT_NEAR(in.mean_signed_mm, -2.0, 0.1);
    EXPECT_THROW((void)surface_residual(boundary, Eigen::Matrix3Xd(3, 0)), InvalidInput);
    EXPECT_THROW((void)surface_residual(boundary, outside.colwise() + Eigen::Vector3d(500, 0, 0)), InvalidInput);
    outside(1, 3) = std::nan("");
    EXPECT_THROW((void)surface_residual(boundary, outside), InvalidInput);
}

}  // namespace
}  // namespace tissuewarp::registration
