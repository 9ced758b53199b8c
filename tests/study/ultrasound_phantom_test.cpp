/// Phantoms of ultrasound: where it shows, what it shows, and that it shows what moved.
#include "study/phantom.hpp"

#include "imaging/sampling.hpp"

#include <gtest/gtest.h>

namespace tissuewarp::study {
namespace {

PhantomOptions bent() {
    PhantomOptions options;
    options.family = Family::Bent;
    options.misplacement = Misplacement{4, 4};
    return options;
}

TEST(UltrasoundPhantom, ShowsAFanOfTheOrganWithSpeckle) {
    const Phantom phantom = random_phantom(11, bent());
    const PhantomUltrasound seen = phantom.ultrasound();
    const imaging::Geometry& grid = seen.fixed.geometry;
    int shown = 0, wrong = 0;
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i) {
                const bool is = seen.fixed.data<float>()[seen.fixed.offset(i, j, k)] > 0;
                shown += is;
                wrong += is != seen.shows(grid.point({double(i), double(j), double(k)}));
            }
    EXPECT_EQ(wrong, 0);
    EXPECT_GT(shown, 0.2 * double(grid.voxel_count()));
    EXPECT_LT(shown, 0.7 * double(grid.voxel_count()));
    int in_view = 0;
    for (const auto& place : phantom.targets.fixed.colwise()) in_view += seen.shows(place);
    EXPECT_GT(in_view, 5);
}

TEST(UltrasoundPhantom, IsMisplacedByNoMoreThanAsked) {
    PhantomOptions options = bent();
    options.misplacement = Misplacement{0, 0};
    const Phantom still = random_phantom(11, options), moved = random_phantom(11, bent());
    EXPECT_EQ(still.targets.moving, moved.targets.moving);
    const Eigen::VectorXd apart = (still.targets.fixed - moved.targets.fixed).colwise().norm();
    EXPECT_GT(apart.maxCoeff(), 0.5);
    EXPECT_LT(apart.maxCoeff(), 4 + 0.07 * 160);
}

/// Of what one volume has where the other shows something, over the values' variation.
double share_of_variance(const imaging::Volume& of, const imaging::Volume& by) {
    const imaging::LinearSampler other(by);
    double n = 0, a = 0, b = 0, aa = 0, bb = 0, ab = 0;
    for (std::int64_t voxel = 0; voxel < of.geometry.voxel_count(); ++voxel) {
        const auto [nx, ny, nz] = of.geometry.size;
        const double value = of.data<float>()[voxel];
        const Eigen::Vector3d place =
            of.geometry.point({double(voxel % nx), double(voxel / nx % ny), double(voxel / nx / ny)});
        if (value == 0 || !other.contains(place)) continue;
        const double shown = other.value(place);
        if (shown < 1) continue;
        n += 1, a += value, b += shown, aa += value * value, bb += shown * shown, ab += value * shown;
    }
    const double covariance = ab - a * b / n;
    return covariance * covariance / ((aa - a * a / n) * (bb - b * b / n));
}

TEST(UltrasoundPhantom, TrackedFramesShowTheSameALittleElsewhere) {
    PhantomOptions tracked = bent();
    tracked.echoes.tracked = true;
    const PhantomUltrasound whole = random_phantom(11, bent()).ultrasound(),
                            frames = random_phantom(11, tracked).ultrasound();
    EXPECT_EQ(cv::norm(whole.moving.voxels, frames.moving.voxels, cv::NORM_INF), 0);
    const auto litres = [](const imaging::Volume& v) {
        return cv::countNonZero(v.voxels.reshape(1, 1)) * v.geometry.spacing.prod();
    };
    EXPECT_LT(litres(frames.fixed), litres(whole.fixed));
    EXPECT_GT(litres(frames.fixed), 0.55 * litres(whole.fixed));
    const double share = share_of_variance(frames.fixed, whole.fixed);
    EXPECT_GT(share, 0.5);  // what a place that is half a millimetre off leaves of speckle
    EXPECT_LT(share, 0.98);
}

TEST(UltrasoundPhantom, FaintEchoesAreOtherEchoesOfTheSameTissue) {
    PhantomOptions faint = bent();
    faint.echoes = {0.25, 0.25, 0.2, 0.2};
    const Phantom phantom = random_phantom(11, bent()), fainter = random_phantom(11, faint);
    EXPECT_EQ(phantom.targets.fixed, fainter.targets.fixed);
    const PhantomUltrasound clear = phantom.ultrasound(), seen = fainter.ultrasound();
    EXPECT_EQ(cv::norm(clear.moving.voxels, seen.moving.voxels, cv::NORM_INF), 0);
    ASSERT_EQ(clear.fixed.voxels.total(), seen.fixed.voxels.total());
    EXPECT_GT(cv::norm(clear.fixed.voxels, seen.fixed.voxels, cv::NORM_L1), double(clear.fixed.voxels.total()));
}

}  // namespace
}  // namespace tissuewarp::study
