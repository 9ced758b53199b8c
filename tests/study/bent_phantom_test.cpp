/// Phantoms that a smooth map bends, their images and vessels, each against something simpler.
#include "study/detail/bent_map.hpp"
#include "study/detail/field_map.hpp"
#include "study/detail/label_organ.hpp"
#include "study/phantom.hpp"

#include "core/errors.hpp"
#include "imaging/filters.hpp"
#include "imaging/labels.hpp"
#include "imaging/sampling.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <utility>

namespace tissuewarp::study {
namespace {

using Eigen::Vector3d;

TEST(BentMap, IsUndoneExactlyAndConservesVolume) {
    detail::Random random(3);
    const Vector3d centre(10, -20, 30);
    const detail::BentMap bend(centre, 100, 12, random);
    double most_mm = 0;
    for (int k = 0; k < 200; ++k) {
        const Vector3d X = centre + 60 * random.normal3();
        const Vector3d x = bend.forward(X);
        EXPECT_LT((bend.backward(x) - X).norm(), 1e-10);
        most_mm = std::max(most_mm, (x - X).norm());
        constexpr double step = 1e-4;
        Eigen::Matrix3d F;
        for (int axis = 0; axis < 3; ++axis) {
            const Vector3d e = step * Vector3d::Unit(axis);
            F.col(axis) = (bend.forward(X + e) - bend.forward(X - e)) / (2 * step);
        }
        EXPECT_NEAR(F.determinant(), 1, 1e-6);
    }
    EXPECT_GT(most_mm, 4);
    EXPECT_LT(most_mm, 12);
}

/// Two balls of one label, of 23 and 8 mm radius, and another label of 9 mm.
imaging::Volume two_balls() {
    imaging::Volume labels({{64, 48, 48}, Vector3d(-40, 0, 5), Vector3d(2, 2, 2)}, CV_32SC1);
    auto* voxel = labels.data<std::int32_t>();
    for (int k = 0; k < 48; ++k)
        for (int j = 0; j < 48; ++j)
            for (int i = 0; i < 64; ++i, ++voxel) {
                const Vector3d x = labels.geometry.point({double(i), double(j), double(k)}) - labels.geometry.origin;
                *voxel = (x - Vector3d(40, 45, 45)).norm() < 23 || (x - Vector3d(80, 45, 45)).norm() < 8 ? 7
                         : (x - Vector3d(105, 45, 45)).norm() < 9                                        ? 4
                                                                                                         : 0;
            }
    return labels;
}

TEST(LabelOrgan, IsTheLargestPieceOfALabelOfSomeSize) {
    const imaging::Volume labels = two_balls();
    detail::Random random(1);
    const detail::LabelOrgan organ = detail::random_label_organ(labels, 20, random);  // 51 ml; the others 2 and 3
    EXPECT_EQ(organ.kind(), "label 7");
    EXPECT_LT((organ.centre() - (labels.geometry.origin + Vector3d(40, 45, 45))).norm(), 0.2);
    for (const double radius : {0.0, 10.0, 20.0, 25.0, 30.0})
        EXPECT_NEAR(organ.outer_distance(organ.centre() + Vector3d(0, radius, 0)), radius - 23, radius > 0 ? 1.5 : 5);
    EXPECT_EQ(organ.label(labels.geometry.origin + Vector3d(80, 45, 45)), 0);
    EXPECT_NEAR(organ.length(), 46, 2.1);
    EXPECT_NEAR(double(imaging::label_statistics(organ.voxels()).at(1).volume_mm3), 4.0 / 3 * EIGEN_PI * 23 * 23 * 23,
                1000);
    EXPECT_THROW(static_cast<void>(detail::random_label_organ(labels, 100, random)), InvalidInput);
}

TEST(LabelOrgan, MayMeetTheBorderOfTheMapAndEndsThereInAFace) {
    const imaging::Volume whole = two_balls();
    imaging::Geometry upper_half = whole.geometry;
    upper_half.size[2] = 24;
    upper_half.origin = whole.geometry.point({0, 0, 24});
    const imaging::Volume labels = imaging::resample(whole, upper_half, imaging::Interpolation::Nearest);
    detail::Random random(1);
    const detail::LabelOrgan organ = detail::random_label_organ(labels, 20, random);
    EXPECT_EQ(organ.kind(), "label 7");
    const Vector3d middle = whole.geometry.origin + Vector3d(40, 45, 45);
    EXPECT_EQ(organ.label(middle + Vector3d(0, 0, 6)), 1);
    EXPECT_EQ(organ.label(middle - Vector3d(0, 0, 6)), 0);
    EXPECT_NEAR(organ.outer_distance(middle - Vector3d(0, 0, 6)), 8, 2);  // the face lies 2 mm above the middle
}

TEST(LabelOrgan, IsAnyThatIsLargeEnough) {
    std::set<std::string> drawn;
    for (std::uint64_t seed = 1; seed <= 30; ++seed) {
        detail::Random random(seed);
        drawn.insert(detail::random_label_organ(two_balls(), 2.5, random).kind());
    }
    EXPECT_EQ(drawn, (std::set<std::string>{"label 4", "label 7"}));
}

/// Displacements of up to 20 mm on a grid of 4 mm, which vary over some 60 mm and change volume.
imaging::Volume waves() {
    imaging::Volume field({{50, 45, 40}, Vector3d(-300, 10, 5), Vector3d(4, 4, 4)}, CV_32FC3);
    auto* voxel = field.data<cv::Vec3f>();
    for (int k = 0; k < 40; ++k)
        for (int j = 0; j < 45; ++j)
            for (int i = 0; i < 50; ++i, ++voxel)
                *voxel = cv::Vec3f(float(20 * std::sin(0.4 * i)), float(15 * std::cos(0.3 * k + 0.2 * j)),
                                   float(10 * std::sin(0.3 * i + 0.3 * k)));
    return field;
}

void give_data_to(PhantomOptions& options) {
    if (options.family == Family::Labelled || options.family == Family::Found) options.organs = two_balls();
    if (options.family == Family::Found) options.fields = {waves()};
}

TEST(FieldMap, BendsTheTissueAndIsUndone) {
    detail::TrueTissue tissue;
    tissue.centre = Vector3d(500, -100, 20);
    tissue.reach = 40;
    tissue.outer_distance = [&](const Vector3d& X) { return (X - tissue.centre).norm() - 40; };
    for (const double motion_mm : {5.0, 500.0}) {
        detail::Random random(4);
        const detail::FieldMap map(waves(), tissue, motion_mm, random);
        double most_mm = 0;
        for (int k = 0; k < 300; ++k) {
            const Vector3d X = tissue.centre + 50 * random.uniform() * random.direction();
            EXPECT_LT((map.backward(map.forward(X)) - X).norm(), 1e-3);
            most_mm = std::max(most_mm, (map.forward(X) - X).norm());
            const Vector3d step = 4 * random.direction();
            EXPECT_LT((map.forward(X + step) - map.forward(X) - step).norm(), 4 * 0.8);
        }
        EXPECT_LE(map.motion_mm(), motion_mm);
        EXPECT_GT(map.motion_mm(), 4.9);
        EXPECT_LT(map.motion_mm(), 60);  // the strain allows no more
        EXPECT_LT(most_mm, 1.05 * map.motion_mm());
        EXPECT_GT(most_mm, 0.6 * map.motion_mm());
    }
}

TEST(FieldMap, AFieldThatMovesAllAlikeIsRefused) {
    imaging::Volume field = waves();
    field.voxels = cv::Scalar(3, 4, 5);
    detail::TrueTissue tissue;
    tissue.reach = 20;
    tissue.outer_distance = [](const Vector3d& X) { return X.norm() - 20; };
    detail::Random random(1);
    EXPECT_THROW(detail::FieldMap(field, tissue, 5, random), InvalidInput);
}

/// Mean difference of grey values between where targets were and where they went, and of the same pairs interchanged.
std::pair<double, double> grey_differences(const Phantom& phantom, const PhantomImages& images) {
    const imaging::LinearSampler before(images.moving), after(images.fixed);
    const auto& [moving, fixed] = phantom.targets;
    double same = 0, other = 0;
    for (Eigen::Index k = 0; k < moving.cols(); ++k) {
        const double here = before.value(moving.col(k));
        same += std::abs(here - after.value(fixed.col(k)));
        other += std::abs(here - after.value(fixed.col((k + 1) % fixed.cols())));
    }
    return {same / double(moving.cols()), other / double(moving.cols())};
}

class PhantomsOf : public testing::TestWithParam<Family> {};

// A map in the wrong direction, or another placement than the labels', shows tissue of other places.
TEST_P(PhantomsOf, ImagesFollowTheTissue) {
    PhantomOptions options;
    options.family = GetParam();
    give_data_to(options);
    const Phantom phantom = random_phantom(8, options);
    const PhantomImages images = phantom.images();
    const auto [same, other] = grey_differences(phantom, images);
    EXPECT_LT(same, 12);  // noise of 3 on either side, interpolation, bias of 5 %
    EXPECT_GT(other, 1.6 * same);
    double in_view = 0;
    for (const auto& x : phantom.targets.fixed.colwise()) in_view += images.view.holds(x);
    EXPECT_NEAR(in_view / double(phantom.targets.fixed.cols()), 0.525, 0.3);
    const imaging::LinearSampler part(images.partial), whole(images.fixed);
    for (const auto& x : phantom.targets.fixed.colwise()) {
        const double depth = images.view.radius_mm - (x - images.view.middle).norm();
        if (depth > 3) {
            EXPECT_NEAR(part.value(x), whole.value(x), 25);
        } else if (depth < -3) {
            EXPECT_EQ(part.value(x), 0);
        }
    }
    EXPECT_EQ(images.degraded.geometry.spacing[2], 4.5);
}

TEST_P(PhantomsOf, VesselsAndLabelsFollowTheTissue) {
    PhantomOptions options;
    options.family = GetParam();
    options.boundary_deviation_mm = 0;
    give_data_to(options);
    const Phantom phantom = random_phantom(8, options);
    ASSERT_GE(phantom.curves.moving.size(), 3u);
    EXPECT_GT(phantom.curves.fixed.cols(), 40);
    int inside = 0, points = 0;
    for (const auto& line : phantom.curves.moving)
        for (const auto& X : line.colwise()) {
            inside += imaging::nearest_value<std::int32_t>(phantom.moving_labels, X) > 0;
            ++points;
        }
    EXPECT_GT(inside, 0.97 * points);
    inside = 0;
    for (const auto& x : phantom.targets.fixed.colwise())
        inside += imaging::nearest_value<std::int32_t>(phantom.fixed_labels, x) > 0;
    EXPECT_GT(inside, 0.97 * double(phantom.targets.fixed.cols()));
    EXPECT_GT(phantom.surface.points.cols(), 100);
}

INSTANTIATE_TEST_SUITE_P(All, PhantomsOf,
                         testing::Values(Family::Solved, Family::Bent, Family::Labelled, Family::Found));

}  // namespace
}  // namespace tissuewarp::study
