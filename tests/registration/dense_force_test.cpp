/// Dense forces between a textured volume and what a known motion and another scanner make of it.
#include "registration/matching/dense/dense_force.hpp"

#include "registration/evaluation.hpp"
#include "tests/registration/textured_phantom.hpp"

#include <Eigen/Eigenvalues>

#include <gtest/gtest.h>

#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <functional>

namespace tissuewarp::registration::detail {
namespace {

using namespace test;
using imaging::Volume;
using Map = std::function<Eigen::Vector3d(const Eigen::Vector3d&)>;
using Tone = std::function<double(double)>;

const imaging::Geometry grid = plain_grid({56, 52, 48});  // 1 mm

Volume everything() {
    Volume seen(grid, CV_8UC1);
    seen.voxels.setTo(1);
    return seen;
}

MatchingImage described(const Volume& image, const Volume& seen) {
    return matching_image(image, seen, grid, SearchRegion(grid));
}

MatchingImage described(const Volume& image) {
    return described(image, everything());
}

std::vector<std::uint8_t> all_voxels() {
    return std::vector<std::uint8_t>(static_cast<std::size_t>(grid.voxel_count()), 1);
}

double same(double value) {
    return value;
}

Volume texture(const Map& back, const Tone& tone = same, double noise = 0, unsigned seed = 1) {
    return sampled(
        grid, [&](const auto& y) { return tone(Texture()(back(y))); }, noise, seed);
}

Eigen::Vector3d still(const Eigen::Vector3d& x) {
    return x;
}

/// Distances (mm) of the shifts found from those of a motion, away from the border of the grid.
std::vector<double> errors(const DenseForces& found, const Map& shift) {
    std::vector<double> result;
    for (const DenseForce& force : found.forces) {
        const Eigen::Vector3d index = grid.index(force.place);
        const Eigen::Array3d last(grid.size[0] - 1, grid.size[1] - 1, grid.size[2] - 1);
        if ((index.array() < 12).any() || (index.array() > last - 12).any()) continue;
        result.push_back((force.shift - shift(force.place)).norm());
    }
    return result;
}

Eigen::Vector3d weighted_mean(const DenseForces& found) {
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    Eigen::Vector3d force = Eigen::Vector3d::Zero();
    for (const DenseForce& f : found.forces) {
        information += f.information;
        force += f.information * f.shift;
    }
    return information.ldlt().solve(force);
}

/// Errors of two steps, the second with the image moved back by the mean of the first, as searches follow each other.
std::vector<double> errors_of_two_steps(const Eigen::Vector3d& shift, const Tone& tone) {
    const MatchingImage moving = described(texture(still));
    const auto step = [&](const Eigen::Vector3d& back) {
        return dense_forces(moving, described(texture([&](const auto& y) { return y - shift + back; }, tone)),
                            all_voxels());
    };
    const Eigen::Vector3d found = weighted_mean(step(Eigen::Vector3d::Zero()));
    return errors(step(found), [&](const auto&) -> Eigen::Vector3d { return shift - found; });
}

/// Mean square of D₂(x + δ) − D₁(x) over inner voxels, D₂ made of the second image moved back by δ.
double mean_square(const MatchingImage& first, const Eigen::Vector3d& moved, const Eigen::Vector3d& back) {
    const MatchingImage second = described(texture([&](const auto& y) { return y - moved + back; }));
    double sum = 0, count = 0;
    for (int k = 12; k < grid.size[2] - 12; ++k)
        for (int j = 12; j < grid.size[1] - 12; ++j)
            for (int i = 12; i < grid.size[0] - 12; ++i)
                for (int c = 0; c < descriptor_channels; ++c) {
                    const auto n = static_cast<std::size_t>(first.offset({i, j, k}) * descriptor_channels + c);
                    const double difference = double(first.descriptors[n]) - double(second.descriptors[n]);
                    sum += difference * difference;
                    ++count;
                }
    return sum / count;
}

// A gradient of the wrong sign, axis or scale leaves a tenth of a voxel and more of a third of one.
TEST(DenseForce, FindsATranslation) {
    const std::vector<double> error = errors_of_two_steps({0.3, -0.2, 0.25}, same);
    ASSERT_GT(error.size(), 200U);
    EXPECT_LT(summarise(error).mean, 0.05);
}

// One shift stands for a window: the part of an affine motion that is linear in x cancels over it.
TEST(DenseForce, FindsAnAffineMotion) {
    Eigen::Matrix3d strain;
    strain << 0.02, 0.01, -0.01, 0.005, -0.015, 0.01, 0.01, 0.0, 0.02;
    const Eigen::Vector3d middle = grid.point({27.5, 25.5, 23.5});
    const Eigen::Matrix3d inverse = (Eigen::Matrix3d::Identity() + strain).inverse();
    const MatchingImage moving = described(texture(still)), fixed = described(texture([&](const auto&y) {
                                                                return Eigen::Vector3d(middle + inverse * (y - middle));
                                                            }));
    const auto error = errors(dense_forces(moving, fixed, all_voxels()),
                              [&](const Eigen::Vector3d& x) -> Eigen::Vector3d { return strain * (x - middle); });
    ASSERT_GT(error.size(), 200U);
    EXPECT_LT(summarise(error).mean, 0.05);
}

// Grey values themselves would push the wrong way here.
TEST(DenseForce, FindsItInAnotherContrast) {
    const Tone inverted = [](double v) { return 3 - 2 * v; }, bent = [](double v) { return std::exp(-1.5 * v); };
    EXPECT_LT(summarise(errors_of_two_steps({0.3, -0.2, 0.25}, inverted)).mean, 0.05);
    EXPECT_LT(summarise(errors_of_two_steps({0.3, -0.2, 0.25}, bent)).mean, 0.1);  // the descriptors themselves differ
}

// Noise and blur flatten descriptors: taken for motion, that moves each cell to where its window is flatter by chance.
TEST(DenseForce, TakesFlatterDescriptorsForNoMotion) {
    const MatchingImage moving = described(texture(still));
    MatchingImage flat = described(texture(still));
    const auto bytes = static_cast<std::size_t>(grid.voxel_count()) * descriptor_channels;
    std::transform(flat.descriptors.get(), flat.descriptors.get() + bytes, flat.descriptors.get(),
                   [](std::uint8_t level) { return static_cast<std::uint8_t>(80 + level / 2); });
    const auto error =
        errors(dense_forces(moving, flat, all_voxels()), [](const auto&) { return Eigen::Vector3d(0, 0, 0); });
    ASSERT_GT(error.size(), 200U);
    EXPECT_LT(summarise(error).mean, 0.01);
}

// The forces point down the cost, by finite differences of it, and one step goes most of the way. A sign or a factor of
// two in A against b leaves half of it.
TEST(DenseForce, FollowsTheGradientOfTheCost) {
    const MatchingImage moving = described(texture(still));
    const Eigen::Vector3d moved(0.4, 0.3, -0.3);
    const MatchingImage fixed = described(texture([&](const auto& y) { return y - moved; }));
    const DenseForces found = dense_forces(moving, fixed, all_voxels());
    Eigen::Vector3d force = Eigen::Vector3d::Zero(), slope;
    for (const DenseForce& f : found.forces) force += f.information * f.shift;
    for (int axis = 0; axis < 3; ++axis) {
        const Eigen::Vector3d step = 0.25 * Eigen::Vector3d::Unit(axis);
        slope[axis] = mean_square(moving, moved, -step) - mean_square(moving, moved, step);
    }
    EXPECT_GT(force.normalized().dot(slope.normalized()), 0.98);
    EXPECT_LT((weighted_mean(found) - moved).norm(), 0.25 * moved.norm());
}

// Padding beyond a field of view must push nothing, nor may voxels that do not count.
TEST(DenseForce, SaysNothingWhereNothingIsShown) {
    const Volume image = texture(still);
    const MatchingImage moving = described(image), fixed = described(texture([](const auto&y) {
                                                       return Eigen::Vector3d(y - Eigen::Vector3d(0.3, 0, 0));
                                                   }));
    const std::vector<std::uint8_t> none(all_voxels().size(), 0);
    EXPECT_TRUE(dense_forces(moving, fixed, none).forces.empty());

    Volume seen = everything();
    for_each_voxel(seen, [&](const Eigen::Vector3d& index, std::int64_t offset) {
        seen.data<std::uint8_t>()[offset] = index[0] < 28;
    });
    const DenseForces half = dense_forces(moving, described(image, seen), all_voxels());
    ASSERT_FALSE(half.forces.empty());
    for (const DenseForce& force : half.forces) EXPECT_LT(grid.index(force.place)[0], 28 - descriptor_reach);
    EXPECT_TRUE(half.say_something_at(grid.point({14, 24, 24})));
    EXPECT_FALSE(half.say_something_at(grid.point({40, 24, 24})));
    EXPECT_FALSE(half.say_something_at(grid.point({-400, 24, 24})));
}

// In one image's own products noise looks like structure that lies just where it is; between two images it cancels.
TEST(DenseForce, TakesNoiseForNoStructure) {
    const auto certainty = [](double signal) {
        const auto noisy = [&](unsigned seed) {
            return described(sampled(
                grid, [&](const auto& y) { return signal * Texture()(y); }, 0.2, seed));
        };
        double sum = 0;
        const DenseForces found = dense_forces(noisy(3), noisy(4), all_voxels());
        for (const DenseForce& force : found.forces) sum += force.information.trace();
        return std::pair(sum, found.agreement);
    };
    const auto [of_noise, by_chance] = certainty(0);
    const auto [of_structure, agreement] = certainty(1);
    EXPECT_LT(of_noise, 0.05 * of_structure);
    EXPECT_NEAR(by_chance, 0, 0.05);
    EXPECT_GT(agreement, 0.2);
    EXPECT_NEAR(dense_forces(described(texture(still)), described(texture(still)), all_voxels()).agreement, 1, 1e-9);
}

TEST(DenseForce, IsTheSameForAnyNumberOfThreads) {
    const MatchingImage moving = described(texture(still, same, 0.1, 5)),
                        fixed = described(texture(still, same, 0.1, 6));
    const DenseForces many = dense_forces(moving, fixed, all_voxels());
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    const DenseForces single = dense_forces(moving, fixed, all_voxels());
    ASSERT_EQ(many.forces.size(), single.forces.size());
    for (std::size_t n = 0; n < many.forces.size(); ++n) {
        EXPECT_EQ(many.forces[n].shift, single.forces[n].shift);
        EXPECT_EQ(many.forces[n].information, single.forces[n].information);
    }
}

// Pulled back along the true displacement the fixed image is the moving one; a field read with the wrong sign, or off
// by its rim, shows another place.
TEST(PulledBackImage, ShowsWhatTheMovingImageShows) {
    const Map before = [](const Eigen::Vector3d& y) { return before_displacement(y); };
    imaging::Geometry wide = grid;  // the fixed image reaches as far as the rim is carried
    wide.origin = grid.point(Eigen::Vector3d::Constant(-16));
    for (int& size : wide.size) size += 32;
    const Volume fixed = sampled(wide, [&](const auto& y) { return Texture()(before(y)); });
    Volume seen(wide, CV_8UC1);
    seen.voxels.setTo(1);
    Volume field(GridSamples::with_rim(grid), CV_32FC3);
    for_each_voxel(field, [&](const Eigen::Vector3d& index, std::int64_t offset) {
        const Eigen::Vector3d u = smooth_displacement(field.geometry.point(index));
        field.data<cv::Vec3f>()[offset] = cv::Vec3f(float(u[0]), float(u[1]), float(u[2]));
    });
    const MatchingImage back = pulled_back_image(fixed, seen, grid, SearchRegion(grid), field),
                        moving = described(texture(still));
    const auto error =
        errors(dense_forces(moving, back, all_voxels()), [](const auto&) { return Eigen::Vector3d::Zero().eval(); });
    ASSERT_GT(error.size(), 200U);
    EXPECT_LT(summarise(error).mean, 0.05);
}

}  // namespace
}  // namespace tissuewarp::registration::detail
