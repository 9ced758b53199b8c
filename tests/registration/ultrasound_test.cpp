/// Ultrasound of a generated organ: known as such, explained by the other image, and registered.
#include "registration/matching/dense/image_engine.hpp"
#include "registration/matching/gpu/gpu_echo_engine.hpp"
#include "registration/matching/ultrasound/echo_costs.hpp"
#include "registration/matching/ultrasound/echo_pose.hpp"
#include "registration/matching/ultrasound/speckle.hpp"
#include "registration/matching/ultrasound/structure_costs.hpp"
#include "registration/matching/ultrasound/ultrasound_search.hpp"
#include "registration/terms/datum_kind.hpp"
#include "registration/terms/image.hpp"
#include "registration/uncertainty.hpp"
#include "registration/update.hpp"
#include "tests/registration/doubt_codes.hpp"
#include "tests/registration/textured_phantom.hpp"
#include "tests/support/label_shapes.hpp"
#include "tests/support/noted.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace tissuewarp::registration {
namespace {

using namespace test;
using imaging::Volume;

constexpr double spacing_mm = 1.5;

struct Organ {
    Volume labels, image;
    PreparedModel model;
};

Organ organ() {
    shapes::Organ shape;
    shape.semi_axes = {30, 26, 24};
    shape.inclusion_radius = 0;
    const Volume labels = shapes::organ_labels(shape, Eigen::Isometry3d::Identity(), spacing_mm);
    const Volume image = sampled(labels.geometry, Texture());
    PrepareOptions options;
    options.meshing.edge_length = 8;
    PreparedModel model = prepare(labels, options);
    ImageModelOptions for_image;
    for_image.features.count = 200;
    for_image.blocks.grid_spacing_mm = spacing_mm;
    prepare_image(model, image, for_image);
    return {labels, image, std::move(model)};
}

/// Where a probe on one side of the organ sees.
bool in_fan(const Eigen::Vector3d& y) {
    const Eigen::Vector3d from_probe = y - Eigen::Vector3d(0, 0, 45);
    return from_probe.norm() < 75 && from_probe.z() < -0.75 * from_probe.norm();
}

/// Brighter where the organ's texture is dark or steep, with speckle; 0 outside of the fan.
Volume echoes(const imaging::Geometry& grid, const Eigen::Isometry3d& pose) {
    cv::RNG random(5);
    const Texture texture;
    return sampled(grid, [&](const Eigen::Vector3d& y) {
        if (!in_fan(y)) return 0.0;
        const Eigen::Vector3d X = pose.inverse() * y;
        Eigen::Vector3d slope;
        for (int axis = 0; axis < 3; ++axis)
            slope[axis] = texture(X + Eigen::Vector3d::Unit(axis)) - texture(X - Eigen::Vector3d::Unit(axis));
        const double echo = 40 + 60 * slope.norm() - 12 * texture(X);
        return std::max(1.0, echo * (1 + random.gaussian(0.3)));
    });
}

Eigen::Isometry3d moved() {
    Eigen::Isometry3d pose(Eigen::AngleAxisd(0.06, Eigen::Vector3d(1, 2, 2).normalized()));
    pose.translation() << 3, -4, 2;
    return pose;
}

/// Mean over the nodes in the fan, mm.
double error_in_view(const Deformation& found, const Eigen::Isometry3d& pose) {
    double sum = 0;
    int count = 0;
    const Eigen::Matrix3Xd at = found.deformed_nodes();
    for (Eigen::Index n = 0; n < at.cols(); ++n) {
        const Eigen::Vector3d is = pose * found.mesh.nodes.col(n);
        if (!in_fan(is)) continue;
        sum += (at.col(n) - is).norm();
        ++count;
    }
    return sum / count;
}

TEST(Speckle, IsWhatUltrasoundShowsAndTissueDoesNot) {
    const Organ one = organ();
    EXPECT_TRUE(detail::is_speckled(detail::SeenImage(echoes(one.labels.geometry, moved()))));
    const Volume bright = sampled(
        one.labels.geometry, [](const Eigen::Vector3d& y) { return in_fan(y) ? 100 + 20 * Texture()(y) : 0.0; }, 2);
    EXPECT_FALSE(detail::is_speckled(detail::SeenImage(bright)));
}

// A scanner's noise is in both images, cut to a part of the organ or not.
TEST(Speckle, ThatTheMovingImageHasTooIsNoSignOfUltrasound) {
    const Organ one = organ();
    const detail::SeenImage ultrasound(echoes(one.labels.geometry, moved()));
    EXPECT_TRUE(detail::has_more_speckle(ultrasound, detail::SeenImage(one.image)));
    cv::RNG random(9);
    const auto noisy = [&](const Eigen::Vector3d& y) { return 100 + 20 * Texture()(y) + random.gaussian(25); };
    const auto in_part = [&](const Eigen::Vector3d& y) { return in_fan(y) ? noisy(y) : 0; };
    const detail::SeenImage whole(sampled(one.labels.geometry, noisy)), part(sampled(one.labels.geometry, in_part));
    EXPECT_TRUE(detail::is_speckled(part)) << "as ultrasound is, by itself";
    EXPECT_FALSE(detail::has_more_speckle(part, whole));
}

/// Of an organ that was shifted by (1, −2, 1) places along the axes of its grid.
template <class Costs>
detail::EchoCosts of_a_shift(const Costs& costs) {
    const Organ one = organ();
    Eigen::Isometry3d shift = Eigen::Isometry3d::Identity();
    shift.translation() = one.labels.geometry.direction * Eigen::Vector3d(3, -6, 3);
    const detail::SeenImage seen(echoes(one.labels.geometry, shift));
    detail::EchoSource source(one.model.model.mesh, one.image, seen);
    const detail::State rest{Eigen::Isometry3d::Identity(), Eigen::Matrix3Xd::Zero(3, one.model.rest.node_count)};
    return costs(source, rest);
}
detail::EchoCosts costs_of_a_shift() {
    return of_a_shift([](detail::EchoSource& source, const detail::State& rest) {
        return detail::echo_costs(source.on_grid(rest, 3, 12), {8, 3, 3});
    });
}

/// Of anything, a part of which each image shows.
detail::EchoImages random_images() {
    detail::EchoImages images;
    images.grid = plain_grid({13, 12, 11}, 3, {5, -7, 9});
    cv::RNG random(3);
    for_each_voxel(Volume(images.grid, CV_8UC1), [&](const Eigen::Vector3d& index, std::int64_t) {
        const bool seen = (index - Eigen::Vector3d(6, 5, 5)).norm() < 4.2;
        images.seen.push_back(seen);
        images.shown.push_back(index[0] > 1);
        images.echo.push_back(seen ? static_cast<float>(random.gaussian(1)) : 0.F);
        images.grey.push_back(static_cast<float>(random.gaussian(1)));
        images.gradient.push_back(static_cast<float>(random.gaussian(1)));
    });
    return images;
}

/// 1 − LC2 voxel by voxel, each weighed as its brick of 2³ is by the window about another; negative where too much is
/// lost.
double unexplained(const detail::EchoImages& images, const Eigen::Vector3i& brick, const Eigen::Vector3i& shift,
                   double window_mm) {
    const double deviation = window_mm / 6;
    const int radius = static_cast<int>(std::lround(2 * deviation));
    double total = 0, shown = 0;
    Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
    Eigen::Vector3d sums = Eigen::Vector3d::Zero();
    for_each_voxel(Volume(images.grid, CV_8UC1), [&](const Eigen::Vector3d& index, std::int64_t n) {
        const Eigen::Vector3i at = index.cast<int>(), from = at - shift, away = at / 2 - brick;
        if (images.seen[std::size_t(n)] == 0 || away.cwiseAbs().maxCoeff() > radius) return;
        const double weight = std::exp(-0.5 * away.cast<double>().squaredNorm() / (deviation * deviation));
        total += weight;
        const auto& size = images.grid.size;
        if ((from.array() < 0).any() || from[0] >= size[0] || from[1] >= size[1] || from[2] >= size[2]) return;
        const auto m = std::size_t(from[0] + size[0] * (from[1] + size[1] * from[2]));
        if (images.shown[m] == 0) return;
        const Eigen::Vector3d values(images.echo[std::size_t(n)], images.grey[m], images.gradient[m]);
        shown += weight;
        sums += weight * values;
        products += weight * values * values.transpose();
    });
    if (shown < (1 - detail::EchoCostOptions().most_lost) * total) return -1;
    Eigen::Matrix3d covariance = products / shown - (sums / shown) * (sums / shown).transpose();
    covariance.bottomRightCorner<2, 2>() += detail::EchoCostOptions().ridge * Eigen::Matrix2d::Identity();
    const Eigen::Vector2d with = covariance.bottomLeftCorner<2, 1>();
    return 1 - with.dot(covariance.bottomRightCorner<2, 2>().inverse() * with) / covariance(0, 0);
}

TEST(EchoCosts, AreThoseOfVoxelsOneByOne) {
    const detail::EchoImages images = random_images();
    constexpr double window_mm = 8;
    const detail::EchoCosts costs = detail::echo_costs(images, {window_mm, 3, 2});
    ASSERT_GT(costs.at.size(), 20U);
    int lost = 0;
    for (std::size_t n = 0; n < costs.at.size(); n += 3)
        for (std::size_t entry = 0; entry < costs.lattice(); entry += 5) {
            const Eigen::Vector3d place = (costs.place(n) - costs.places.origin) / 6;
            const Eigen::Vector3i brick = place.array().round().cast<int>();
            const double direct = unexplained(images, brick, costs.shift(entry), window_mm);
            if (direct < 0) {
                ++lost;
                EXPECT_TRUE(std::isinf(costs.of(n)[entry]));
            } else
                EXPECT_NEAR(costs.of(n)[entry], direct, 1e-4);
        }
    EXPECT_GT(lost, 0);
}

/// Windows that are lost are the same, and costs to rounding.
void expect_alike(const detail::EchoCosts& found, const detail::EchoCosts& expected) {
    EXPECT_EQ(found.at, expected.at);
    EXPECT_EQ(found.window_share, expected.window_share);
    ASSERT_EQ(found.cost.size(), expected.cost.size());
    double most = 0;
    for (std::size_t n = 0; n < found.cost.size(); ++n) {
        ASSERT_EQ(std::isfinite(found.cost[n]), std::isfinite(expected.cost[n])) << n;
        if (std::isfinite(found.cost[n])) most = std::max<double>(most, std::abs(found.cost[n] - expected.cost[n]));
    }
    EXPECT_LT(most, 1e-4);
}

// A few shifts at a time, the last fewer, and all at once.
TEST(EchoEngine, TheDeviceSaysWhatTheProcessorSays) {
    const detail::EchoImages images = random_images();
    detail::MatchDevice device(-1);
    detail::CpuEchoEngine cpu;
    for (const std::size_t most_values : {std::size_t{30000}, std::size_t{1} << 24U}) {
        detail::GpuEchoEngine gpu(device, most_values);
        for (const int reach : {3, 2}) {
            const detail::EchoCostOptions linear{8, reach, 2};
            expect_alike(gpu.linear_combination(images, linear), cpu.linear_combination(images, linear));
            const detail::StructureCostOptions structure{9, 1, reach, 2};
            expect_alike(gpu.structure(images, structure), cpu.structure(images, structure));
        }
    }
}

Eigen::Vector3i least_shift(const detail::EchoCosts& costs) {
    Eigen::VectorXd total = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(costs.lattice()));
    for (std::size_t n = 0; n < costs.at.size(); ++n)
        for (std::size_t entry = 0; entry < costs.lattice(); ++entry)
            total[static_cast<Eigen::Index>(entry)] += std::min(costs.of(n)[entry], 1.F);
    Eigen::Index least = 0;
    total.minCoeff(&least);
    return costs.shift(static_cast<std::size_t>(least));
}

TEST(EchoCosts, AreLeastAtTheShiftThatWasMade) {
    const detail::EchoCosts costs = costs_of_a_shift();
    ASSERT_GT(costs.at.size(), 20U);
    EXPECT_EQ(least_shift(costs), Eigen::Vector3i(1, -2, 1));
}

TEST(StructureCosts, AreLeastAtTheShiftThatWasMade) {
    const detail::EchoCosts costs = of_a_shift([](detail::EchoSource& source, const detail::State& rest) {
        return detail::structure_costs(source.on_grid(rest, 1.5, 12), {8, 2, 3, 3});
    });
    EXPECT_DOUBLE_EQ(costs.step_mm, 3);
    ASSERT_GT(costs.at.size(), 20U);
    EXPECT_EQ(least_shift(costs), Eigen::Vector3i(1, -2, 1));
}

// How the organ is turned, they can hardly say.
TEST(EchoPose, IsSoughtFromAFewPlacesCloseTogether) {
    const detail::EchoCosts all = costs_of_a_shift();
    for (const std::size_t count : {1, 2, 3}) {
        detail::EchoCosts few = all;
        few.at.resize(count);
        few.cost.resize(count * few.lattice());
        few.window_share.resize(count);
        const detail::EchoPose found = detail::echo_pose({{few}}, {}, silent_observer());
        EXPECT_TRUE(found.motion.matrix().allFinite());
        EXPECT_LT(found.motion.translation().norm(), 30) << count;
    }
}

TEST(UltrasoundUpdate, FindsTheOrganAndSaysHowItCompared) {
    const Organ one = organ();
    UpdateOptions options;
    options.device = Device::Cpu;
    Intraoperative seen;
    seen.image = echoes(one.labels.geometry, moved());
    tissuewarp::test::Noted observer;
    const UpdateResult result = update(one.model, seen, options, observer);
    EXPECT_NE(observer.notes.find("ultrasound"), std::string::npos) << observer.notes;
    // Its doubts are about poses that a search tells apart: no update goes on without one.
    const UpdateResult next =
        Updater(std::shared_ptr<const PreparedModel>(std::shared_ptr<void>(), &one.model), options).go_on(result, seen);
    EXPECT_FALSE(next.beginning.at_last);
    EXPECT_NE(next.beginning.why.find("must be sought"), std::string::npos) << next.beginning.why;
    Deformation before = result.deformation;
    before.displacement.setZero();
    before.placement.setIdentity();
    EXPECT_GT(error_in_view(before, moved()), 4);
    EXPECT_LT(error_in_view(result.deformation, moved()), 1);
}

// Through what an update asks, and both measures of likeness.
TEST(UltrasoundSearch, FindsThePoseOnADeviceWhereTheProcessorDoes) {
    const Organ one = organ();
    const detail::SeenImage seen(echoes(one.labels.geometry, moved()));
    const detail::State rest{Eigen::Isometry3d::Identity(), Eigen::Matrix3Xd::Zero(3, one.model.rest.node_count)};
    detail::UltrasoundSearchOptions options;
    options.pose.costs.reach = options.structure.reach = 4;  // a software rasteriser takes its time
    const auto pose_by = [&](detail::ImageEngine& engine) {
        detail::UltrasoundSearch search(one.model.model.mesh, one.image, seen, engine.echoes(), options);
        return search.pose(rest, silent_observer());
    };
    const detail::EchoPose expected = pose_by(*detail::make_cpu_image_engine(one.model.model.mesh, *one.model.image)),
                           found = pose_by(*detail::make_gpu_image_engine(one.model.model.mesh, *one.model.image));
    EXPECT_LT((found.motion.matrix() - expected.motion.matrix()).cwiseAbs().maxCoeff(), 0.05);
    EXPECT_NEAR(found.support, expected.support, 1e-2 * expected.support);
}

TEST(UltrasoundDoubts, AreOfEchoesThatNothingExplainsAndOfPosesThatFitAsWell) {
    detail::EchoPose pose;
    pose.support = 60;
    pose.rival_mm = 11;
    pose.rival_support = 20;
    EXPECT_TRUE(detail::doubts_of_echoes(0.2, pose, "image").empty());
    pose.rival_support = 55;
    EXPECT_EQ(codes(detail::doubts_of_echoes(0.01, pose, "image")),
              (std::vector<std::string>{"image.echoes_unexplained", "image.two_poses"}));
}

TEST(UltrasoundKind, SharesLargerErrorsWhereLessIsExplained) {
    EXPECT_DOUBLE_EQ(detail::ultrasound_kind(0.9).shared_mm, detail::ultrasound_kind(0.3).shared_mm);
    EXPECT_NEAR(detail::ultrasound_kind(0.3 / 4).shared_mm, 2 * detail::ultrasound_kind(0.3).shared_mm, 1e-12);
    EXPECT_DOUBLE_EQ(detail::ultrasound_kind(-1).shared_mm, detail::ultrasound_kind(0.01).shared_mm);
}

// A slab lies between places every few voxels apart; what has one value shows nothing.
TEST(UltrasoundUpdate, OfASlabIsDoubtedAndOfNothingRefused) {
    const Organ one = organ();
    UpdateOptions options;
    options.device = Device::Cpu;
    options.image.similarity = Similarity::LinearCombination;
    const Volume whole = echoes(one.labels.geometry, moved());
    Intraoperative seen;
    seen.image = Volume(whole.geometry, CV_32FC1);
    seen.image->voxels = 0;
    EXPECT_THROW(update(one.model, seen, options), InvalidInput);
    for_each_voxel(whole, [&](const Eigen::Vector3d& index, std::int64_t n) {
        if (std::abs(index[0] - whole.geometry.size[0] / 2 - 1.5) < 1)
            seen.image->data<float>()[n] = whole.data<float>()[n];
    });
    const UpdateResult result = update(one.model, seen, options);
    EXPECT_FALSE(result.doubts.empty());
    const UncertaintySummary known = summarise(uncertainty(one.model, result));
    EXPECT_FALSE(std::isfinite(known.interval_mm)) << "nothing was found: that is not within 0.00 mm";
    EXPECT_NEAR(known.unknown_share, 1, 1e-9);
}

TEST(UltrasoundUpdate, DoubtsEchoesOfSomethingElse) {
    const Organ one = organ();
    UpdateOptions options;
    options.device = Device::Cpu;
    options.image.similarity = Similarity::LinearCombination;
    cv::RNG random(6);
    Intraoperative seen;
    seen.image = sampled(one.labels.geometry, [&](const Eigen::Vector3d& y) {
        return in_fan(y) ? std::max(1.0, 40 * (1 + random.gaussian(0.3))) : 0.0;
    });
    const auto found = codes(update(one.model, seen, options).doubts);
    EXPECT_NE(std::find(found.begin(), found.end(), "image.pose_unclear"), found.end());
}

}  // namespace
}  // namespace tissuewarp::registration
