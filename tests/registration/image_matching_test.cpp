/// Blocks of a generated phantom found where a known deformation brought them.
#include "registration/matching/image_matching.hpp"

#include "core/errors.hpp"
#include "tests/registration/textured_phantom.hpp"

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <Eigen/Eigenvalues>

#include <algorithm>
#include <limits>
#include <map>

namespace tissuewarp::registration {
namespace {

using namespace test;
using imaging::Volume;

double median(std::vector<double> values) {
    std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
    return values[values.size() / 2];
}

/// The textured phantom before and after, and points to match.
struct Pair {
    Volume moving, fixed;
    Eigen::Matrix3Xd points;
};

Pair deformed_pair(
    const std::function<double(double)>& contrast = [](double v) { return v; }, double noise = 0) {
    const auto grid = plain_grid({72, 64, 60}, 1.0, {-36, -32, -30});
    const Texture texture;
    Pair pair{sampled(grid, texture, noise, 1),
              sampled(
                  grid, [&](const auto& y) { return contrast(texture(before_displacement(y))); }, noise, 2),
              {}};
    FeatureOptions features;
    features.count = 300;
    pair.points = select_feature_points(pair.moving, core_mask(grid, 14), features).points;
    return pair;
}

std::vector<double> errors(const std::vector<BlockMatch>& matches) {
    std::vector<double> result;
    for (const BlockMatch& match : matches)
        result.push_back((match.fixed - match.moving - smooth_displacement(match.moving)).norm());
    return result;
}

BlockMatchingOptions searching(double range_mm) {
    BlockMatchingOptions options;
    options.search_mm = range_mm;
    return options;
}

/// Points looked for where they were.
std::vector<BlockMatch> matches_of(const Volume& moving, const Volume& fixed, const Eigen::Matrix3Xd& points,
                                   double range_mm) {
    return match_blocks(MatchingTemplate(moving, points), fixed, points, searching(range_mm));
}

// A sign error, a swapped axis or a grid off by half a voxel lifts the median above the bound.
TEST(ImageMatching, FindsAKnownDeformationToAThirdOfAVoxel) {
    const Pair pair = deformed_pair();
    ASSERT_GE(pair.points.cols(), 200);
    const auto matches = matches_of(pair.moving, pair.fixed, pair.points, 8);
    EXPECT_GE(static_cast<Eigen::Index>(matches.size()), pair.points.cols() * 9 / 10);
    EXPECT_LT(median(errors(matches)), 0.3);
    EXPECT_LT(median(errors(consistent_matches(matches))), 0.3);
}

// A descriptor that depends on the sign or the scale of the contrast finds nothing here.
TEST(ImageMatching, SeesThroughInvertedContrastAndNoise) {
    const Pair pair = deformed_pair([](double v) { return std::exp(-1.5 * v); }, 0.15);
    const auto matches = matches_of(pair.moving, pair.fixed, pair.points, 8);
    const auto kept = consistent_matches(matches);
    EXPECT_GE(static_cast<Eigen::Index>(kept.size()), pair.points.cols() / 2);
    EXPECT_LT(median(errors(kept)), 0.5);
}

// Frames mixed up, or a rotation left out of the working grid, throw the matches off by millimetres.
TEST(ImageMatching, MapsBetweenObliqueAnisotropicGridsAcrossARotation) {
    const Texture texture;
    const Eigen::Isometry3d pose = motion(20, {1, -2, 3}, {12, -7, 30});
    const Volume moving = sampled(oblique_grid({0, 0, 0}, {85, 75, 47}, {1, 1.1, 1.7}), texture);
    const Volume fixed = sampled(oblique_grid(pose.translation(), {71, 84, 85}, {1.2, 1, 1}),
                                 [&](const auto& y) { return texture(pose.inverse() * y); });
    FeatureOptions features;
    features.count = 150;
    const auto points = select_feature_points(moving, core_mask(moving.geometry, 24), features).points;
    BlockMatchingOptions options = searching(4);
    options.rotation = pose.linear();
    const Eigen::Matrix3Xd off = (pose * points).colwise() + Eigen::Vector3d(2, -1.5, 1);
    const auto matches = match_blocks(MatchingTemplate(moving, points), fixed, off, options);
    ASSERT_GE(static_cast<Eigen::Index>(matches.size()), points.cols() * 9 / 10);
    std::vector<double> distances;
    for (const BlockMatch& match : matches) distances.push_back((match.fixed - pose * match.moving).norm());
    EXPECT_LT(median(distances), 0.3);
}

// Information along a plane edge would pin tissue to where the noise happened to look alike.
TEST(ImageMatching, APlaneEdgeTellsOfItsNormalAlone) {
    const auto grid = plain_grid({48, 48, 48}, 1.0, {-24, -24, -24});
    const Eigen::Vector3d normal = Eigen::Vector3d(2, 1, 0.5).normalized();
    const auto edge_at = [&](double place) {
        return [&normal, place](const Eigen::Vector3d& x) { return std::tanh((normal.dot(x) - place) / 2); };
    };
    const Volume moving = sampled(grid, edge_at(0), 0.004, 3), fixed = sampled(grid, edge_at(2.5), 0.004, 4);
    Eigen::Matrix3Xd points(3, 25);
    const Eigen::Vector3d u = normal.unitOrthogonal(), v = normal.cross(u);
    for (int n = 0; n < 25; ++n) points.col(n) = 3.0 * (n % 5 - 2) * u + 3.0 * (n / 5 - 2) * v;
    const auto matches = matches_of(moving, fixed, points, 6);
    ASSERT_GE(matches.size(), 12u);
    std::vector<double> along, ratios, off;
    for (const BlockMatch& match : matches) {
        const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(match.information);
        along.push_back(std::abs(axes.eigenvectors().col(2).dot(normal)));
        ratios.push_back(axes.eigenvalues()[2] / std::max(axes.eigenvalues()[1], 1e-12));
        off.push_back(std::abs(normal.dot(match.fixed - match.moving) - 2.5));
    }
    EXPECT_GT(median(along), 0.98);
    EXPECT_GT(median(ratios), 10);
    EXPECT_LT(median(off), 0.3);
}

// Zeros beyond the field of view must neither attract blocks nor spoil those beside the cut.
TEST(ImageMatching, NothingIsFoundBeyondTheFieldOfView) {
    Pair pair = deformed_pair();
    constexpr double cut = 4;  // mm: the fixed image shows x below it
    for_each_voxel(pair.fixed, [&](const Eigen::Vector3d& index, std::int64_t offset) {
        if (pair.fixed.geometry.point(index)[0] > cut) pair.fixed.data<float>()[offset] = 0;
    });
    const auto matches = matches_of(pair.moving, pair.fixed, pair.points, 8);
    ASSERT_GE(matches.size(), 80u);
    EXPECT_LT(median(errors(matches)), 0.3);
    // A block is found by the part of it that is shown, also where its centre is not.
    constexpr double half_block = 4.5;
    std::vector<BlockMatch> beside;
    for (const BlockMatch& match : matches) {
        EXPECT_LT(match.fixed[0], cut + half_block) << "point " << match.point;
        if (std::abs(match.fixed[0] - cut) < half_block) beside.push_back(match);
    }
    ASSERT_GE(beside.size(), 10u);
    EXPECT_LT(median(errors(beside)), 0.4);
    for (const BlockMatch& match : matches)
        EXPECT_LT(match.moving[0] + smooth_displacement(match.moving)[0], cut + half_block + 1);
}

// A second search, from where a model puts the points, needs the finest grids alone; copies of a template share it.
TEST(ImageMatching, TheFinestGridsAloneServeAGoodPrediction) {
    const Pair pair = deformed_pair();
    const MatchingTemplate first(pair.moving, pair.points), copy = first;
    EXPECT_EQ(&first.images(), &copy.images());
    Eigen::Matrix3Xd predicted = pair.points;
    for (Eigen::Index n = 0; n < predicted.cols(); ++n)
        predicted.col(n) += smooth_displacement(pair.points.col(n)) + Eigen::Vector3d(1, -1, 0.5);
    BlockMatchingOptions options = searching(3);
    options.skipped_levels = 2;
    const auto matches = match_blocks(copy, pair.fixed, predicted, options);
    EXPECT_GE(static_cast<Eigen::Index>(matches.size()), pair.points.cols() * 9 / 10);
    EXPECT_LT(median(errors(matches)), 0.3);
}

// Beside padding dense forces say nothing: there, and only there, the finest grid is asked. Matches of a coarser one
// know less of a place; those of the wrong points would be the other way about.
TEST(ImageMatching, TheFinestGridMayBeKeptForWhatIsNotDescribed) {
    Pair pair = deformed_pair();
    constexpr double cut = 4;  // mm: the moving image shows x below it
    for_each_voxel(pair.moving, [&](const Eigen::Vector3d& index, std::int64_t offset) {
        if (pair.moving.geometry.point(index)[0] > cut) pair.moving.data<float>()[offset] = 0;
    });
    const MatchingTemplate moving(pair.moving, pair.points);
    BlockMatchingOptions options = searching(8);
    const auto all = match_blocks(moving, pair.fixed, pair.points, options);
    options.finest = FinestGrid::UndescribedPoints;
    const auto some = match_blocks(moving, pair.fixed, pair.points, options);
    std::map<int, double> known;
    for (const BlockMatch& match : all) known[match.point] = match.information.trace();
    std::vector<double> beside, away;  // information over that of the finest grid
    for (const BlockMatch& match : some) {
        if (!known.contains(match.point)) continue;
        const double depth = cut - match.moving[0], ratio = match.information.trace() / known[match.point];
        if (depth > -2 && depth < 3) beside.push_back(ratio);
        if (depth > 6) away.push_back(ratio);
    }
    ASSERT_GE(beside.size(), 5u);
    ASSERT_GE(away.size(), 20u);
    EXPECT_NEAR(median(beside), 1, 0.15);
    EXPECT_LT(median(away), 0.7);
    EXPECT_LT(median(errors(some)), 0.4);
}

// Sums in an order that depends on scheduling differ in their last digits.
TEST(ImageMatching, OneThreadAndManyFindTheSame) {
    const Pair pair = deformed_pair([](double v) { return v; }, 0.1);
    const auto run = [&](std::size_t threads) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        return consistent_matches(matches_of(pair.moving, pair.fixed, pair.points, 8));
    };
    const auto one = run(1), many = run(4);
    ASSERT_EQ(one.size(), many.size());
    for (std::size_t n = 0; n < one.size(); ++n) {
        EXPECT_EQ(one[n].point, many[n].point);
        EXPECT_EQ(one[n].fixed, many[n].fixed);
        EXPECT_EQ(one[n].confidence, many[n].confidence);
        EXPECT_EQ(one[n].information, many[n].information);
    }
}

// Matches that nothing bears out must not look sure: a filter or a spring would believe them.
TEST(ImageMatching, AnUnrelatedImageIsNotBelieved) {
    const Pair pair = deformed_pair();
    const Volume noise = sampled(
        pair.fixed.geometry, [](const auto&) { return 0.0; }, 1, 9);
    const auto matches = matches_of(pair.moving, noise, pair.points, 8);
    EXPECT_LT(static_cast<Eigen::Index>(matches.size()), pair.points.cols() / 10);
    EXPECT_LT(static_cast<Eigen::Index>(consistent_matches(matches).size()), pair.points.cols() / 50);
}

TEST(ImageMatching, RefusesHostileInput) {
    const auto grid = plain_grid({20, 20, 20});
    const Volume image = sampled(grid, Texture());
    const Eigen::Matrix3Xd points = Eigen::Matrix3Xd::Constant(3, 2, 10.0);
    Volume broken = image.clone();
    broken.data<float>()[77] = std::numeric_limits<float>::quiet_NaN();
    EXPECT_THROW(MatchingTemplate(broken, points), InvalidInput);
    EXPECT_THROW(MatchingTemplate(Volume(), points), InvalidInput);
    EXPECT_THROW(MatchingTemplate(image, Eigen::Matrix3Xd(3, 0)), InvalidInput);
    Eigen::Matrix3Xd infinite = points;
    infinite(1, 1) = std::numeric_limits<double>::infinity();
    EXPECT_THROW(MatchingTemplate(image, infinite), InvalidInput);
    const Eigen::Matrix3Xd far_off = points.array() + 1e9;
    EXPECT_THROW(MatchingTemplate(image, far_off), InvalidInput);
    TemplateOptions too_fine;
    too_fine.grid_spacing_mm = 0;
    EXPECT_THROW(MatchingTemplate(image, points, too_fine), InvalidInput);

    const MatchingTemplate moving(image, points);
    EXPECT_THROW(match_blocks(moving, broken, points), InvalidInput);
    EXPECT_THROW(match_blocks(moving, Volume(), points), InvalidInput);
    EXPECT_THROW(match_blocks(moving, Volume(image.geometry, CV_32FC3), points), InvalidInput);
    Volume large(image.geometry, CV_64FC1);
    large.data<double>()[77] = 1e300;  // no float32
    EXPECT_THROW(match_blocks(moving, large, points), InvalidInput);
    EXPECT_THROW(match_blocks(moving, image, Eigen::Matrix3Xd::Zero(3, 3)), InvalidInput);
    EXPECT_THROW(match_blocks(moving, image, infinite), InvalidInput);
    EXPECT_THROW(match_blocks(moving, image, far_off), InvalidInput);
    BlockMatchingOptions options;
    options.skipped_levels = moving.options().levels;
    EXPECT_THROW(match_blocks(moving, image, points, options), InvalidInput);
    options = {};
    options.search_mm = 900;  // far more voxels than a lattice can have
    EXPECT_THROW(match_blocks(moving, image, points, options), InvalidInput);
    options = {};
    options.search_mm = -1;
    EXPECT_THROW(match_blocks(moving, image, points, options), InvalidInput);
    options = {};
    options.rotation.setZero();
    EXPECT_THROW(match_blocks(moving, image, points, options), InvalidInput);

    const Volume mask = core_mask(grid, 2), nothing(grid, CV_8UC1);
    EXPECT_THROW((void)select_feature_points(broken, mask), InvalidInput);
    EXPECT_THROW((void)select_feature_points(image, nothing), InvalidInput);
    EXPECT_THROW((void)select_feature_points(Volume(grid, CV_32FC1), mask), InvalidInput);
    const Volume elsewhere = core_mask(plain_grid({20, 20, 20}, 1.0, {500, 0, 0}), 2);
    EXPECT_THROW((void)select_feature_points(image, elsewhere), InvalidInput);
}

// Points that crowd on the strongest edge leave the rest of the organ without data.
TEST(FeaturePoints, AreSpreadAndPreferCorners) {
    const auto grid = plain_grid({60, 60, 60});
    const auto box = [](const Eigen::Vector3d& x) {
        double value = 1;
        for (int a = 0; a < 3; ++a) value *= 0.5 * (1 - std::tanh((std::abs(x[a] - 30) - 12) / 1.5));
        return value;
    };
    const Volume image = sampled(grid, box, 0.001);
    FeatureOptions options;
    options.count = 60;
    const FeaturePoints found = select_feature_points(image, core_mask(grid, 8), options);
    ASSERT_GE(found.points.cols(), 30);
    ASSERT_EQ(static_cast<std::size_t>(found.points.cols()), found.structure.size());
    for (int n = 0; n < 8; ++n)  // the box has eight corners at 30 ± 12
        for (int a = 0; a < 3; ++a) EXPECT_NEAR(std::abs(found.points(a, n) - 30), 12, 3);
    double nearest = std::numeric_limits<double>::infinity();
    for (Eigen::Index n = 0; n < found.points.cols(); ++n)
        for (Eigen::Index m = 0; m < n; ++m)
            nearest = std::min(nearest, (found.points.col(n) - found.points.col(m)).norm());
    EXPECT_GT(nearest, 6);
}

BlockMatch isotropic_match(const Eigen::Vector3d& moving, const Eigen::Vector3d& fixed) {
    BlockMatch match;
    match.moving = moving;
    match.fixed = fixed;
    match.confidence = 0.8;
    match.information = 25 * Eigen::Matrix3d::Identity();
    return match;
}

/// Matches on an affine motion, every fifth of them thrown off by 6 mm.
std::vector<BlockMatch> matches_with_outliers() {
    cv::RNG random(5);
    Eigen::Matrix3d affine = Eigen::Matrix3d::Identity();
    affine << 1.05, 0.03, 0, -0.04, 0.96, 0.02, 0, 0.05, 1.02;
    std::vector<BlockMatch> matches;
    for (int n = 0; n < 300; ++n) {
        const Eigen::Vector3d x(random.uniform(-40.0, 40.0), random.uniform(-40.0, 40.0), random.uniform(-40.0, 40.0));
        const Eigen::Vector3d direction(random.gaussian(1), random.gaussian(1), random.gaussian(1));
        const Eigen::Vector3d y = affine * x + Eigen::Vector3d(3, -2, 1);
        matches.push_back(isotropic_match(x, n % 5 == 0 ? Eigen::Vector3d(y + 6 * direction.normalized()) : y));
        matches.back().point = n;
    }
    return matches;
}

TEST(ConsistentMatches, DropWhatNeighboursDoNotBearOut) {
    const auto kept = consistent_matches(matches_with_outliers());
    EXPECT_GE(kept.size(), 235u);  // of 240: some have too many outliers about them
    for (const BlockMatch& match : kept) EXPECT_NE(match.point % 5, 0);
}

// A match on an edge that slid along it is as good as one that did not.
TEST(ConsistentMatches, JudgeEdgesAcrossThemAlone) {
    auto matches = matches_with_outliers();
    std::erase_if(matches, [](const BlockMatch& match) { return match.point % 5 == 0; });
    matches[7].fixed += Eigen::Vector3d(0, 5, 0);
    matches[7].information = Eigen::Vector3d(25, 1e-6, 25).asDiagonal();
    matches[8].fixed += Eigen::Vector3d(0, 5, 0);
    matches[8].information = Eigen::Vector3d(1e-6, 25, 1e-6).asDiagonal();
    const int edge = matches[7].point, outlier = matches[8].point;
    const auto kept = consistent_matches(matches);
    const auto has = [&](int point) {
        return std::any_of(kept.begin(), kept.end(), [&](const BlockMatch& match) { return match.point == point; });
    };
    EXPECT_TRUE(has(edge));
    EXPECT_FALSE(has(outlier));
}

TEST(ConsistentMatches, TakeNoneAndOne) {
    EXPECT_TRUE(consistent_matches({}).empty());
    EXPECT_LE(consistent_matches({isotropic_match({0, 0, 0}, {1, 0, 0})}).size(), 1u);
}

}  // namespace
}  // namespace tissuewarp::registration
